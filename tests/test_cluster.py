"""Where workers are: what is asked for, and which are refused."""

import tomllib
from importlib import import_module

import pytest

from omnieval import cluster
from omnieval.cluster import SLURM, ClusterExecutor, ClusterSpec, LostClusterError, Slurm, differing_workers
from omnieval.cores import SHARE
from omnieval.errors import ConfigError
from tests.cli.test_cli import fails, in_process


class Elsewhere:
    """A scheduler that has as many threads as is said, one number for each time that somebody asks."""

    status = "running"
    dashboard_link = None

    def __init__(self, *threads: int) -> None:
        self._threads = iter((1, *threads))  # it is asked once when the executor is made

    def get_executor(self, **_: object) -> None:
        return None

    def nthreads(self) -> dict[str, int]:
        return {"worker": next(self._threads)}


def test_workers_are_missed_from_when_it_is_first_seen(monkeypatch):
    """Nobody looks while jobs are long, or the driver is busy: what was then is not known."""
    now = [0.0]
    monkeypatch.setattr("omnieval.cluster.time.monotonic", lambda: now[0])
    executor = ClusterExecutor(Elsewhere(0, 0, 2, 0, 0, 0), ClusterSpec("local:2", local=2))
    for seconds in (100.0, 159.0, 170.0, 300.0, 359.0):
        now[0] = seconds
        executor.check()
    now[0] = 361.0
    with pytest.raises(LostClusterError, match="for 60 seconds"):
        executor.check()


def test_what_is_asked_for(monkeypatch, tmp_path):
    monkeypatch.setenv(SHARE, "1")
    assert ClusterSpec.parse("local:4") == ClusterSpec("local:4", local=4)
    assert ClusterSpec.parse("local:auto").local == 1
    assert ClusterSpec.parse("tcp://host:8786") == ClusterSpec("tcp://host:8786")
    file = tmp_path / "slurm.toml"
    file.write_text('workers = 2\nqueue = "short"\nwait = 5\n')
    assert ClusterSpec.parse(str(file)).slurm == Slurm(workers=2, queue="short", wait=5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("local:0", "expected local:N"),
        ("local:many", "expected local:N"),
        ("localhost:8786", "expected local:N, the address of a scheduler"),
        ("none.toml", "cannot read none.toml"),
        ("bad.toml", "cannot read bad.toml"),
        ("wrong.toml", "workers: .*; memry: .*--cluster-template"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_one_line(text, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.toml").write_text("workers =")
    (tmp_path / "wrong.toml").write_text('workers = 0\nmemry = "4GB"')
    with pytest.raises(ConfigError, match=words):
        ClusterSpec.parse(text)


def test_the_template_is_read_and_names_every_setting(tmp_path):
    printed = in_process("ablate", "--cluster-template", "slurm", cwd=tmp_path)
    assert (printed.returncode, printed.stdout, printed.stderr) == (0, SLURM, "")
    whole = tomllib.loads("\n".join(line.removeprefix("# ") if " = " in line else line for line in SLURM.splitlines()))
    assert Slurm.model_validate(whole).model_fields_set == Slurm.model_fields.keys()
    assert Slurm.model_validate(tomllib.loads(SLURM)).wait == 600
    fails(in_process("ablate", "--cluster-template", "pbs", cwd=tmp_path), 2, "there is one, slurm")


def test_without_dask_one_line_says_what_to_install(panoramas, monkeypatch, tmp_path):
    def absent(name):
        if name == "distributed":
            raise ModuleNotFoundError(f"No module named '{name}'")
        return import_module(name)

    monkeypatch.setattr(cluster, "import_module", absent)
    failed = in_process("ablate", panoramas, "--cluster", "local:2", "--out", "out", cwd=tmp_path)
    fails(failed, 2, "--cluster local:2 needs Dask: pip install 'omnieval[dask]'")
    assert not (tmp_path / "out").exists()


def test_where_to_run_is_said_once(panoramas, tmp_path):
    both = in_process("ablate", panoramas, "--cluster", "local:2", "--jobs", 2, "--out", "out", cwd=tmp_path)
    fails(both, 2, "give one of them")


def test_workers_that_differ_are_named_with_what_differs():
    here = {"code": "1", "numpy": "2.0"}
    answers = {
        "tcp://a:1": here,
        "tcp://c:1": "ModuleNotFoundError: No module named 'omnieval'",
        "tcp://b:1": {"code": "2", "numpy": "2.0"},
        "tcp://d:1": {"code": "1"},
    }
    assert differing_workers(answers, here) == [
        "tcp://b:1: code is 2, here 1",
        "tcp://c:1: ModuleNotFoundError: No module named 'omnieval'",
        "tcp://d:1: numpy is absent, here 2.0",
    ]
