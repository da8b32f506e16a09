"""Commands as processes that can be stopped at any moment, and what they leave on disk."""

import contextlib
import json
import os
import random
import select
import signal
import subprocess
import sys
import time

import numpy as np
import polars as pl

from omnieval.errors import ResultError
from omnieval.recording.viewer import check_recording
from omnieval.results.content import content_hash
from omnieval.results.manifest import read_manifest, status_of
from omnieval.results.run_folder import open_run

SETTINGS = ("--set", "n_init=10", "--set", "n_new=10", "--set", "gamma=1")
REPLAY = (*SETTINGS, "--set", "omega=3.5", "--set", "merge_y=0.5")
GRID = (*SETTINGS, "--vary", "omega=0.5,3.5", "--vary", "merge_y=0.5,20,1000")

OFTEN = "import omnieval.results.run_folder as folder; folder._PART_ROWS = 5"
"""Lets a short run write as many parts as a long one."""

MORE = 5
"""Times as many kills, at most, until one was in the middle: how fast a command is may change from one to the next."""

_CODE = """
import sys
import omnieval.ablation.run, omnieval.loop, omnieval.recording.recorder
from omnieval.cli import main
{prepare}
print("ready", flush=True)
sys.stdin.readline()
main(sys.argv[1:])
"""


def start(cwd, *arguments, **options):
    """Start a command in a process group of its own and return it when its libraries are loaded; see `load`."""
    return go(load(cwd, *arguments, **options))


def load(cwd, *arguments, prepare="", **options):
    """Return the process of a command that loads its libraries and then waits for `go`.

    Parameters
    ----------
    cwd, options
        As of `subprocess.Popen`.
    arguments
        The command line.
    prepare
        Python to run before.
    """
    return subprocess.Popen(
        [sys.executable, "-c", _CODE.format(prepare=prepare), *map(str, arguments)],
        cwd=cwd,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **options,
    )


def go(process):
    """Let a loaded command begin."""
    assert process.stdin
    assert process.stdout
    assert process.stdout.readline() == "ready\n", process.communicate()
    process.stdin.write("go\n")
    process.stdin.flush()
    return process


def one_ahead(loading):
    """Yield processes; while one is looked at, the next one loads its libraries. One that nobody wants is killed."""
    waiting = next(loading)
    try:
        for following in loading:  # which has begun to load before we continue with the one that waits
            wanted, waiting = waiting, following
            yield go(wanted)
        wanted, waiting = waiting, None
        yield go(wanted)
    finally:
        if waiting is not None:
            waiting.kill()
            end(waiting)


def end(process):
    """Wait for a command and return its exit code, stdout and stderr."""
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err


def run(cwd, *arguments, **options):
    """Run a command to its end; see `end`."""
    return end(start(cwd, *arguments, **options))


def span(cwd, *arguments, **options):
    """Return how many seconds a command runs when it is left alone."""
    process = start(cwd, *arguments, **options)
    began = time.monotonic()
    code, _, err = end(process)
    assert code == 0, err
    return time.monotonic() - began


def parts(count, seed):
    """Yield a random number in each of so many equal parts of 0 to 1, then ever more of anywhere in between."""
    rng = random.Random(seed)
    yield from ((part + rng.random()) / count for part in range(count))
    while True:
        yield rng.random()


def kill_after(seconds, process):
    """Kill a command unless it ends before; return its exit code when nobody of its group is left, and its seconds."""
    began = time.monotonic()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(timeout=seconds)
    took = time.monotonic() - began
    with contextlib.suppress(ProcessLookupError):
        os.kill(process.pid, signal.SIGKILL)
    code, _, _ = end(process)
    group_ends(process)
    return code, took


def wait_for(condition, process):
    """Wait until `condition` holds of a running command."""
    while not condition():
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=0.005)
            raise AssertionError(f"it has ended before: {end(process)}")


def group_ends(process):
    """Wait until no process of a command's group is left."""
    deadline = time.monotonic() + 20
    with contextlib.suppress(ProcessLookupError):
        while True:
            os.killpg(process.pid, 0)
            assert time.monotonic() < deadline, "somebody is left behind"
            select.select([], [], [], 0.01)


def one_line(text):
    """Check that a command said one line, no traceback, and return it."""
    lines = text.splitlines()
    assert len(lines) == 1, text
    assert lines[0].startswith("omnieval: ")
    assert "unexpected" not in lines[0]
    return lines[0]


def whole(folder):
    """Check that every file under its final name is whole, and return their names."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".tmp"]
    for path in files:
        if path.suffix == ".parquet":
            pl.read_parquet(path)
        elif path.suffix == ".json":
            json.loads(path.read_text("utf-8"))
        elif path.name == "map.npz":
            with np.load(path, allow_pickle=False) as arrays:
                assert all(arrays[name].size for name in ("orientations", "labels"))
        elif path.name == "replay.rrd":
            assert check_recording(path) > 0
        else:
            assert path.name == "replay.partial.rrd" or path.suffix in {".npy", ".csv"}, path
    return sorted(path.relative_to(folder).as_posix() for path in files)


def begun(folder):
    """Whether a command came so far as to say what it does."""
    return (folder / "run.json").exists()


def status(folder, kind):
    return status_of(read_manifest(folder, kind))


def prefix_of(folder, reference):
    """Check that the steps a run has on disk are the first ones of the reference; return how many."""
    late = ("node_final", "placement", "forced", "milliseconds")
    steps = open_run(folder).steps.drop(late)
    assert content_hash(steps) == content_hash(reference.steps.head(len(steps)).drop(late))
    return len(steps)


def steps_recorded(path):
    """Return the number of steps a recording shows, 0 if it does not open."""
    try:
        return check_recording(path)
    except ResultError:
        return 0


def table_hash(folder):
    """Return the content hash of the table of an ablation."""
    return content_hash(pl.read_parquet(folder / "ablation.parquet"))
