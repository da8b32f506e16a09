"""An ablation that is killed goes on where it was, to the table of one that was never stopped."""

import os
import signal
import subprocess
import sys

import polars as pl
import pytest

from omnieval.results.content import content_hash
from omnieval.results.manifest import read_manifest, status_of

ABLATE = ("--set", "n_init=10", "--set", "n_new=10", "--set", "gamma=1", "--vary", "omega=0.5,3.5")
GRID = (*ABLATE, "--vary", "merge_y=0.5,20,1000")
JOBS = 6

KILLED = (
    "import os, signal, sys\n"
    "from omnieval.ablation.store import Store\n"
    "add, rows = Store.add, []\n"
    "def killed(store, *row):\n"
    "    add(store, *row)\n"
    "    rows.append(row)\n"
    "    if len(rows) == int(sys.argv[1]):\n"
    "        os.kill(os.getpid(), signal.SIGKILL)\n"
    "Store.add = killed\n"
    "from omnieval.cli import main\n"
    "main(sys.argv[2:])\n"
)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="has no SIGKILL")


def ablate(cwd, *arguments, code="import sys; from omnieval.cli import main; main(sys.argv[1:])"):
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, env=dict(os.environ))


@pytest.fixture(scope="module")
def uninterrupted(panoramas, tmp_path_factory):
    cwd = tmp_path_factory.mktemp("uninterrupted")
    assert ablate(cwd, "ablate", panoramas, *GRID, "--out", "out").returncode == 0
    return pl.read_parquet(cwd / "out" / "ablation.parquet")


@pytest.mark.parametrize(("processes", "rows"), [(1, 2), pytest.param(2, 3, marks=pytest.mark.slow)])
def test_a_killed_ablation_resumes_to_the_same_table(uninterrupted, panoramas, tmp_path, processes, rows):
    arguments = ("ablate", panoramas, *GRID, "--jobs", processes, "--out", "out")
    killed = ablate(tmp_path, rows, *arguments, code=KILLED)
    assert killed.returncode == -signal.SIGKILL
    out = tmp_path / "out"
    assert status_of(read_manifest(out, "ablation")) == "interrupted"
    kept = {path: path.read_bytes() for path in (out / "parts").glob("*.json")}
    assert len(kept) == rows < JOBS
    assert not (out / "ablation.parquet").exists()

    resumed = ablate(tmp_path, *arguments, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    assert all(path.read_bytes() == content for path, content in kept.items())
    table = pl.read_parquet(out / "ablation.parquet")
    assert table.drop("seconds").equals(uninterrupted.drop("seconds"))
    assert content_hash(table) == content_hash(uninterrupted)
    assert status_of(read_manifest(out, "ablation")) == "complete"
    assert not list(out.rglob("*.tmp"))
