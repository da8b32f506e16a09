"""What a run and an ablation come to that nothing happens to."""

import sys

import pytest

from omnieval.results.run_folder import open_run
from tests.cli.test_cli import in_process
from tests.faults.commands import GRID, REPLAY

collect_ignore_glob = ["test_*.py"] if sys.platform == "win32" else []  # signals, locks and limits of POSIX


@pytest.fixture(scope="session")
def replayed(panoramas, tmp_path_factory):
    """A complete run."""
    cwd = tmp_path_factory.mktemp("replayed")
    result = in_process("replay", panoramas, *REPLAY, "--out", "run", cwd=cwd)
    assert result.returncode == 0, result.stderr
    return open_run(cwd / "run")


@pytest.fixture(scope="session")
def ablated(panoramas, replayed, tmp_path_factory):
    """The folder of a complete ablation."""
    cwd = tmp_path_factory.mktemp("ablated")
    result = in_process("ablate", panoramas, *GRID, "--keep-steps", "--out", "out", cwd=cwd)
    assert result.returncode == 0, result.stderr
    return cwd / "out"
