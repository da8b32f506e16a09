"""Every command and every Python block of the documentation runs, in a small world of its own (`site`)."""

import contextlib
import io
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from omnieval.recording import viewer
from tests.cli.test_cli import in_process
from tests.docs.pages import PAGES, ROOT, blocks
from tests.docs.site import build, substituted

pytestmark = pytest.mark.slow

NOT_RUN = {
    "python3 -m venv .venv": "makes a virtual environment from the network; CI runs it",
    "pip install": "installs from the network; CI does",
    "python docs/examples/efficientnet_lite0.py": "needs the network; tests/docs/test_efficientnet.py has it",
    "python -m tests.benchmarks.panoramas": "needs pairs of panoramas; a measurement, not a test",
    "omnieval replay synthetic:cloudy:2": "renders a sequence, and needs the network's file",
    "omnieval localize runs/map-2-lite0": "the same",
    "omnieval compare runs/light-*": "the same",
    "omnieval replay synthetic:cloudy:4": "renders a sequence; tests/localization has it",
    "omnieval localize runs/map-4-geodesic": "the same",
    "omnieval replay --descriptor onnx:": "needs the network's file; tests/descriptors/test_network.py has it",
    "torch.onnx.export": "needs torch, and weights of others: marked as not run",
    "omnieval replay --spawn": "opens a window; tests/recording/test_view.py has it",
    "omnieval replay --connect": "needs a viewer that listens; tests/recording/test_view.py has it",
    "omnieval view --web": "serves until Ctrl-C; tests/cli/test_view.py has it",
    "omnieval dataset fetch": "needs the network; tests/datasets/test_fetch.py has it",
    "omnieval ablate --preset benchmark": "renders fifteen sequences; tests/comparison/test_page.py has it",
    "omnieval ablate synthetic:cloudy:2": "renders two sequences; tests/comparison/test_page.py has it",
    "omnieval ablate --cluster ": "starts workers; tests/ablation/test_cluster.py has it",
    "omnieval doctor": "takes many seconds; tests/cli/test_doctor.py has it",
    "from omnieval.recording.notebook import show": "needs a notebook; tests/recording/test_notebook.py has it",
    "from omnieval.recording.notebook import progress": "needs a notebook; tests/recording/test_notebook.py has it",
    "RecordingOptions(spawn=True)": "opens a window; tests/recording/test_view.py has it",
}
"""Beginnings of commands, and words of programs, that are not run, and why."""


@pytest.fixture(scope="module")
def site(small_building, tmp_path_factory):
    """One world for all pages: what one of them has made, another may use."""
    folder = tmp_path_factory.mktemp("site")
    build(folder)
    return folder


@pytest.fixture
def no_window(monkeypatch):
    """What a viewer would have been given."""
    given: list[Path] = []
    monkeypatch.setattr(viewer, "open_viewer", given.extend)
    return given


def test_every_command_runs(site, no_window):
    failed, done = [], set()
    for block in (block for page in PAGES for block in blocks(page, "sh")):
        for line in block.text.splitlines():
            command = " ".join(shlex.split(line, comments=True))
            if not command or command in done or any(map(command.startswith, NOT_RUN)):
                continue
            done.add(command)  # many stand on several pages
            code, said = run(substituted(command, site, ROOT), site)
            if code != 0:
                failed.append(f"{block.where}: {command}: exit code {code}: {said}")
    assert not failed, "\n".join(failed)
    assert len(done) > 50
    assert {path.name.partition("-by-side")[0] for path in no_window} >= {"replay.rrd", "side"}


@pytest.mark.parametrize(
    "block",
    [block for page in PAGES for block in blocks(page, "python") if not any(words in block.text for words in NOT_RUN)],
    ids=lambda block: block.where,
)
def test_every_program_runs(block, site, monkeypatch):
    monkeypatch.chdir(site)
    program = compile(substituted(block.text, site, ROOT), block.where, "exec")
    with contextlib.redirect_stdout(io.StringIO()):
        exec(program, {"__name__": "__main__"})


def test_what_is_not_run_stands_somewhere():
    everything = "".join(page.read_text("utf-8") for page in PAGES)
    assert [words for words in NOT_RUN if words not in everything] == []


def test_there_are_no_other_kinds_of_blocks():
    shown_only = {"yaml", "toml", "text", ""}
    kinds = {language for page in PAGES for language in ("sh", "python", *shown_only) if list(blocks(page, language))}
    assert kinds <= {"sh", "python", *shown_only}
    fences = sum(page.read_text("utf-8").count("\n```") for page in PAGES)
    assert fences == 2 * sum(len(list(blocks(page, language))) for page in PAGES for language in kinds)


def run(command, cwd):
    """Run a command as a shell would, and return its exit code and what it said."""
    words, _, target = command.partition(" > ")
    program, *arguments = [path for word in shlex.split(words) for path in expanded(word, cwd)]
    if program == "python":
        result = subprocess.run(
            [sys.executable, *arguments], cwd=cwd, capture_output=True, text=True, check=False, env=dict(os.environ)
        )
    else:
        assert program == "omnieval", f"{program}: not a command of the documentation"
        result = in_process(*arguments, cwd=cwd)
    if target:
        (cwd / target).write_text(result.stdout)
    return result.returncode, result.stderr


def expanded(word, cwd):
    """Return what a shell makes of a word."""
    return [str(path.relative_to(cwd)) for path in sorted(Path(cwd).glob(word))] if "*" in word else [word]
