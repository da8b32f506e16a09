"""Workers of a cluster: the table is that of one process, whoever dies. All in processes of their own, as users do."""

import json
import os
import subprocess
import sys
import threading

import polars as pl
import pytest

from omnieval.ablation.crew import ClusterCrew, Crew
from omnieval.ablation.worker import Named, facts
from omnieval.errors import ConfigError
from omnieval.results.manifest import read_manifest
from tests.ablation.test_growth import trace_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="has no SIGKILL")

DYING = """
import os, signal
from pathlib import Path
from omnieval.mapping.leader import Leader

class {name}(Leader):
    name = "{lower}"

    def decide(self, frame):
        file = Path(os.environ.get("{name}_KILLS", "none"))
        if frame == 5 and file.exists():
            pid = int(file.read_text() or os.getpid())
            if {once}:
                file.unlink()
            os.kill(pid, signal.SIGKILL)
        return super().decide(frame)
"""
VARY = ("--vary", "radius=2,4")


@pytest.fixture(scope="module")
def mappers(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mappers")
    for name, once in (("Once", True), ("Always", False)):
        (folder / f"{name}.py").write_text(DYING.format(name=name, lower=name.lower(), once=once))
    return [f"{folder / name}.py:{name}" for name in ("Once", "Always")]


def ablate(cwd, *arguments, **environment):
    command = [sys.executable, "-m", "omnieval", "ablate", *map(str, arguments)]
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, check=False, env={**os.environ, **environment}
    )


def table(folder):
    return pl.read_parquet(folder / "ablation.parquet").drop("seconds")


@pytest.fixture(scope="module")
def alone(panoramas, mappers, tmp_path_factory):
    cwd = tmp_path_factory.mktemp("alone")
    done = ablate(cwd, panoramas, *VARY, "--mapper", f"leader,{','.join(mappers)}", "--keep-steps", "--out", "out")
    assert done.returncode == 0, done.stderr
    return cwd / "out"


@pytest.mark.faults
def test_a_worker_that_is_killed_costs_its_tree_at_most(panoramas, mappers, alone, tmp_path):
    for name in ("Once", "Always"):
        (tmp_path / name).touch()
    kills = {f"{name}_KILLS": str(tmp_path / name) for name in ("Once", "Always")}
    arguments = (panoramas, *VARY, "--mapper", f"leader,{','.join(mappers)}", "--keep-steps", "--out", "out")
    # With a cache of its own, so that workers describe the images too.
    done = ablate(tmp_path, *arguments, "--cluster", "local:2", OMNIEVAL_CACHE=str(tmp_path / "cache"), **kills)
    assert done.returncode == 5, done.stderr
    assert "2 workers of local:2" in done.stderr
    assert not (tmp_path / "Once").exists()
    found, expected = table(tmp_path / "out"), table(alone)
    assert found.filter(pl.col("mapper") != "always").equals(expected.filter(pl.col("mapper") != "always"))
    errors = found.filter(mapper="always")["error"].to_list()
    assert len(errors) == 2
    assert all("KilledWorker" in error for error in errors)
    for job in range(4):
        assert trace_of(tmp_path / "out", job).equals(trace_of(alone, job))
    assert ablate(tmp_path, *arguments, "--resume").returncode == 0
    assert table(tmp_path / "out").equals(expected)


@pytest.mark.faults
def test_a_scheduler_that_is_lost_loses_nothing_that_is_done(panoramas, mappers, alone, tmp_path):
    grid = (panoramas, *VARY, "--mapper", f"leader,{','.join(mappers)}", "--keep-steps", "--out", "out")
    pid = tmp_path / "pid"
    started = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--host", "127.0.0.1"]
    processes = [start(*started, "--no-dashboard", "--scheduler-file", tmp_path / "file.json", cwd=tmp_path)]
    try:
        address = address_of(processes[0])
        pid.write_text(str(processes[0].pid))
        worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny"]
        processes.append(start(*worker, "--no-dashboard", cwd=tmp_path, Once_KILLS=str(pid)))
        lost = ablate(tmp_path, *grid, "--cluster", address)
    finally:
        for process in processes:
            process.kill()
            process.communicate()
    assert (lost.returncode, "Traceback" in lost.stderr) == (1, False), lost.stderr
    assert lost.stderr.splitlines()[-1].endswith("is lost; what is done is kept, go on with --resume"), lost.stderr
    assert read_manifest(tmp_path / "out", "ablation")["status"] == "failed"
    assert ablate(tmp_path, *grid, "--resume").returncode == 0
    assert table(tmp_path / "out").equals(table(alone))


def start(*command, cwd, **environment):
    return subprocess.Popen(
        [*map(str, command)], cwd=cwd, stderr=subprocess.PIPE, text=True, env={**os.environ, **environment}
    )


def address_of(scheduler):
    """Read what a scheduler says until it names its address, and drop the rest."""
    for line in scheduler.stderr:
        if "Scheduler at:" in line:
            threading.Thread(target=scheduler.stderr.read, daemon=True).start()
            return line.split()[-1]
    raise AssertionError("the scheduler has no address")


SBATCH = """#!/bin/sh
cp "$1" "$SUBMITTED"
{ sh "$SUBMITTED" >worker.log 2>&1; } </dev/null >/dev/null 2>&1 &
echo $! >worker.pid
echo "Submitted batch job 7"
"""


@pytest.mark.slow
def test_jobs_of_slurm_as_a_fake_sbatch_runs_them(panoramas, mappers, alone, tmp_path):
    bin_ = tmp_path / "bin"
    bin_.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", "#!/bin/sh\necho $@ >cancelled\n")):
        (bin_ / name).write_text(text)
        (bin_ / name).chmod(0o755)
    asked = ("workers = 1", 'memory = "2GB"', 'queue = "short"', 'directives = ["--constraint=avx2"]', "wait = 120")
    (tmp_path / "slurm.toml").write_text("\n".join((*asked, 'prologue = ["export SEEN=1"]')))
    grid = (panoramas, *VARY, "--mapper", f"leader,{','.join(mappers)}", "--keep-steps", "--out", "out")
    environment = {"PATH": f"{bin_}{os.pathsep}{os.environ['PATH']}", "SUBMITTED": str(tmp_path / "job.sh")}
    done = ablate(tmp_path, *grid, "--cluster", "slurm.toml", **environment)
    assert done.returncode == 0, done.stderr
    assert table(tmp_path / "out").equals(table(alone))
    job = (tmp_path / "job.sh").read_text().splitlines()
    for line in ("#SBATCH -p short", "#SBATCH --constraint=avx2", "#SBATCH --cpus-per-task=1", "#SBATCH --mem=2G"):
        assert line in job
    assert "export SEEN=1" in job
    assert (tmp_path / "cancelled").read_text() == "7\n"
    assert json.loads((tmp_path / "out" / "run.json").read_text())["timings"]["processes"] == 1


class Elsewhere:
    """Workers that say of themselves what they are told to."""

    count = 2

    def __init__(self, answers):
        self.answers = answers

    def everywhere(self, function, *args):
        del function, args
        return self.answers


def test_workers_that_differ_are_refused_by_name():
    other = {**facts(), "numpy": "1.0"}
    with pytest.raises(ConfigError, match=r"nothing was run: tcp://b: numpy is 1\.0, here"):
        ClusterCrew(Elsewhere({"tcp://a": facts(), "tcp://b": other}), [])  # type: ignore[arg-type]
    assert isinstance(ClusterCrew(Elsewhere({"tcp://a": facts()}), []), Crew)  # type: ignore[arg-type]


def test_components_that_a_worker_has_not_or_otherwise_are_facts(mappers, tmp_path):
    absent: Named = ("mapper", str(tmp_path / "none.py:Mine"), {})
    here: Named = ("mapper", mappers[0], {})
    told = facts([absent, here])
    assert "not there" in told[f"the code of mapper {absent[1]}"]
    assert told[f"the code of mapper {here[1]}"].isalnum()
