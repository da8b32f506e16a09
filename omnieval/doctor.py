"""`omnieval doctor`: what a bug report should say of an installation, and whether it works at all.

The self-test runs in a process and a temporary folder of its own, so that whatever happens there, a crash of a
library included, is a line of the report, and nothing of it is left.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import locale
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

from omnieval.cores import allotted
from omnieval.descriptors.cache_folder import DESCRIPTIONS, STREAMS, cache_state
from omnieval.locks import kind_of_locks
from omnieval.wording import counted

FRAMES = 40
_SETTINGS = {"n_init": 10, "n_new": 10}
_PATIENCE_S = 600.0
_VIEWER_PATIENCE_S = 30.0
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_MISSING = "not installed"
_NAME = re.compile(r"[A-Za-z0-9._-]+")
_FOR_DEVELOPERS = re.compile(r"extra == .(test|dev)\b")
_CHILD = "import sys; from omnieval.doctor import report_self_test; report_self_test(sys.argv[1])"


@dataclass(frozen=True)
class SelfTest:
    """How the self-test ended.

    Attributes
    ----------
    ok
        Whether a synthetic sequence was rendered, replayed, recorded and read back.
    failure
        What went wrong, in a line; None if nothing did.
    facts
        Results of the replay, by name. ``decisions`` is a digest of all verdicts: equal where they are.
    """

    ok: bool
    failure: str | None
    facts: dict[str, Any]


@dataclass(frozen=True)
class Examination:
    """What is known of an installation: names and plain values, by section. The home folder reads ``~``."""

    versions: dict[str, str]
    machine: dict[str, str]
    blas: dict[str, str]
    cache: dict[str, str]
    viewer: dict[str, str]

    @property
    def sections(self) -> dict[str, dict[str, str]]:
        """The sections by name, in order."""
        return asdict(self)


def examine() -> Examination:
    """Look at the installation; nothing is changed."""
    return Examination(_versions(), _machine(), _blas(), _cache(), _viewer())


def self_test() -> SelfTest:
    """Render, replay, record and read back a small synthetic sequence in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="omnieval-doctor-") as scratch:
        environment = {**os.environ, "OMNIEVAL_CACHE": str(Path(scratch) / "cache")}
        command = [sys.executable, "-c", _CHILD, scratch]
        try:
            ended = subprocess.run(
                command, env=environment, capture_output=True, text=True, timeout=_PATIENCE_S, check=False
            )
        except subprocess.TimeoutExpired:
            return SelfTest(ok=False, failure=f"it did not end within {_PATIENCE_S:g} s", facts={})
    if ended.returncode == 0:
        return SelfTest(ok=True, failure=None, facts=json.loads(ended.stdout))
    return SelfTest(ok=False, failure=_last_words(ended), facts={})


def report_self_test(scratch: str) -> None:
    """Do the self-test in a folder and print its facts as JSON; any error ends this process."""
    import omnieval
    from omnieval.datasets.synthetic import synthesize
    from omnieval.errors import ResultError
    from omnieval.recording import RecordingOptions
    from omnieval.recording.digest import digest
    from omnieval.results.content import folder_hash
    from omnieval.results.run_folder import open_run

    sequence = synthesize(Path(scratch) / "sequence", frames=FRAMES)
    replayed = omnieval.replay(
        f"cold:{sequence}",
        config=omnieval.configure(_SETTINGS),
        out=Path(scratch) / "run",
        recording=RecordingOptions(),
    )
    run = open_run(replayed.folder)
    if run.status != "complete" or len(run.steps) != FRAMES:
        raise ResultError(f"{run.folder} has {len(run.steps)} steps and is {run.status}; please report it")
    if run.content_hash != folder_hash(run.manifest["content_hashes"]):
        raise ResultError(f"the tables of {run.folder} do not read as they were written; please report it")
    if failure := run.manifest["recording_failure"]:
        raise ResultError(f"the recording failed: {failure}; please report it")
    digest(run.recording)  # reads every row
    verdicts = "\n".join(map(str, run.steps.select("frame", "verdict", "node").iter_rows()))
    facts = {
        "frames": FRAMES,
        "nodes": run.metrics["nodes"],
        "frames per second": round(run.manifest["timings"]["frames_per_second"], 1),
        "decisions": hashlib.blake2b(verdicts.encode(), digest_size=8).hexdigest(),
        "recording": f"{run.recording.stat().st_size / 1e6:.1f} MB, reads back",
    }
    print(json.dumps(facts))


def _versions() -> dict[str, str]:
    """Return the versions of all that omnieval runs with; not of what only its developers need."""
    needed = [line for line in requires("omnieval") or () if not _FOR_DEVELOPERS.search(line)]
    names = {match.group(): line for line in needed if (match := _NAME.match(line))}
    found = {name: _version(name) for name in names}
    own = {"omnieval": version("omnieval"), "python": platform.python_version()}
    return own | {  # what only another system needs is not missing
        name: one for name, one in found.items() if one != _MISSING or "sys_platform" not in names[name]
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return _MISSING


def _machine() -> dict[str, str]:
    from omnieval.recording.pipe import PIPES

    return {
        "platform": platform.platform(),
        "machine": platform.machine(),
        "python": f"{platform.python_implementation()}, {_homeless(sys.executable)}",
        "cores": f"{os.cpu_count()}, {allotted()} of them usable",
        "locks": kind_of_locks(),
        "recordings": "written by omnieval" if PIPES else "written by Rerun: a full disk may stop a replay for ever",
        "encoding": f"{locale.getpreferredencoding(do_setlocale=False)}, file names {sys.getfilesystemencoding()}",
    }


def _blas() -> dict[str, str]:
    """Return the libraries that do the arithmetic, once NumPy, SciPy and scikit-learn have loaded them."""
    from threadpoolctl import threadpool_info

    for module in ("numpy", "scipy.linalg", "sklearn.cluster"):
        importlib.import_module(module)
    found = {}
    for pool in sorted(threadpool_info(), key=lambda pool: str(pool["prefix"])):
        name = f"{pool['prefix']} ({pool['user_api']})"
        details = [pool.get("version"), pool.get("architecture"), f"{pool['num_threads']} threads"]
        found[name] = ", ".join(detail for detail in details if detail)
    return found | {name: os.environ[name] for name in _THREAD_VARIABLES if name in os.environ}


def _cache() -> dict[str, str]:
    state = cache_state()
    streams = state.of(STREAMS)
    kept = f"{state.of(DESCRIPTIONS).count} in {counted(state.sets, 'set')}, {counted(state.segments, 'segment')}"
    return {
        "folder": _homeless(str(state.folder)),
        "writable": "yes" if state.writable else "no",
        "size": f"{state.bytes / 1e6:.1f} MB",
        "descriptions": kept if state.segments else "0",
        "videos and bags": f"{counted(streams.count, 'folder')}, {streams.bytes / 1e6:.1f} MB, in streams",
        "integrity": state.integrity,
    }


def _viewer() -> dict[str, str]:
    sdk = version("rerun-sdk")
    path = shutil.which("rerun")
    if path is None:
        return {"rerun": f"not on PATH; omnieval view starts that of rerun-sdk {sdk}"}
    try:
        said = subprocess.run(
            [path, "--version"], capture_output=True, text=True, timeout=_VIEWER_PATIENCE_S, check=False
        ).stdout
    except (OSError, subprocess.TimeoutExpired) as error:
        return {"rerun": f"{_homeless(path)} does not answer: {_homeless(str(error))}"}
    found = re.search(r"\d+\.\d+\.\d+\S*", said)
    number = found.group() if found else "of unknown version"
    match = "as is rerun-sdk" if number == sdk else f"but rerun-sdk is {sdk}: it may not open recordings of omnieval"
    return {"rerun": f"{_homeless(path)} {number}, {match}"}


def _last_words(ended: subprocess.CompletedProcess[str]) -> str:
    lines = ended.stderr.strip().splitlines()
    reason = lines[-1] if lines else "without a word"
    killed = f" (signal {-ended.returncode})" if ended.returncode < 0 else ""
    return _homeless(f"{reason}{killed}")


def _homeless(text: str) -> str:
    """Return `text` with the home folder as ``~``: it names a person."""
    home = str(Path("~").expanduser())
    return text.replace(home, "~") if len(home) > 1 else text
