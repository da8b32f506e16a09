"""Two runs over the same images, replayed through the command line."""

import pytest

from tests.cli.test_cli import SMALL, in_process


@pytest.fixture(scope="session")
def two_runs(panoramas, tmp_path_factory):
    """A working directory with the runs ``a`` (with a recording) and ``b`` (gamma 20, without)."""
    cwd = tmp_path_factory.mktemp("two-runs")
    source = f"folder:{panoramas}"
    assert in_process("replay", source, *SMALL, "--no-images", "--out", "a", cwd=cwd).returncode == 0
    strict = ("--set", "gamma=20", "--no-rrd", "--out", "b")
    assert in_process("replay", source, *SMALL, *strict, cwd=cwd).returncode == 0
    return cwd
