"""The same run under every circumstance that must not matter: equal to the bit."""

import json
import os
import random
import shutil

import polars as pl
import pytest

from omnieval.recording.digest import digest
from omnieval.results.content import content_hash
from omnieval.results.run_folder import open_run
from tests.cli.test_cli import in_process
from tests.faults.commands import GRID, REPLAY, run, table_hash

pytestmark = pytest.mark.faults


def at_the_step(steps):
    """The columns of a step that are settled when it is taken."""
    return steps.drop("node_final", "placement", "forced", "milliseconds")


SHUFFLED = """
import os, random
scandir, listdir = os.scandir, os.listdir
class Shuffled(list):
    def __enter__(self): return self
    def __exit__(self, *error): pass
    def close(self): pass
def mixed(entries):
    entries = Shuffled(entries)
    random.Random(5).shuffle(entries)
    return entries
def shuffled(path="."):
    with scandir(path) as entries:
        return mixed(entries)
os.scandir = shuffled
os.listdir = lambda path=".": mixed(listdir(path))
"""
"""Lets the system list folders in another order."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")

CIRCUMSTANCES = {
    "hash seed 0, one thread": {"PYTHONHASHSEED": "0", **dict.fromkeys(THREADS, "1")},
    "hash seed 1, two threads": {"PYTHONHASHSEED": "1", **dict.fromkeys(THREADS, "2")},
    "random hash seed, far away, in German": {
        "PYTHONHASHSEED": "random",
        "TZ": "Pacific/Chatham",
        "LC_ALL": "de_DE.UTF-8",
        "LANGUAGE": "de",
    },
    "no time zone, no locale": {"TZ": "", "LC_ALL": "C"},
}


@pytest.mark.parametrize("name", CIRCUMSTANCES)
def test_a_replay_does_not_depend_on_the_environment(panoramas, replayed, tmp_path, name):
    environment = os.environ | CIRCUMSTANCES[name]
    code, _, err = run(tmp_path, "replay", panoramas, *REPLAY, "--out", "run", env=environment)
    assert (code, err) == (0, "")
    same(open_run(tmp_path / "run"), replayed)
    assert digest(tmp_path / "run" / "replay.rrd") == digest(replayed.recording)


def same(one, other):
    """Check that two runs say the same, and that run.json says so too."""
    assert one.content_hash == other.content_hash
    for entry in ("content_hashes", "identity", "dataset_fingerprint", "metrics", "smallest_margin", "camera"):
        assert one.manifest[entry] == other.manifest[entry], entry


def test_a_replay_does_not_depend_on_the_order_of_files_the_cache_or_the_recording(panoramas, replayed, tmp_path):
    mixed = tmp_path / panoramas.name
    mixed.mkdir()
    files = sorted(panoramas.iterdir())
    random.Random(3).shuffle(files)
    for file in files:
        shutil.copyfile(file, mixed / file.name)
    environment = os.environ | {"OMNIEVAL_CACHE": str(tmp_path / "cache")}
    arguments = ("replay", mixed, *REPLAY, "--no-rrd", "--out")
    for name in ("cold", "warm"):
        code, _, err = run(tmp_path, *arguments, name, prepare=SHUFFLED, env=environment)
        assert (code, err) == (0, "")
        same(open_run(tmp_path / name), replayed)
    caches = [open_run(tmp_path / name).manifest["cache"] for name in ("cold", "warm")]
    assert [cache["hits"] for cache in caches] == [0, len(files) - 1]
    unusable = environment | {"OMNIEVAL_CACHE": "/dev/null/none"}
    assert run(tmp_path, *arguments, "none", env=unusable)[0] == 0
    same(open_run(tmp_path / "none"), replayed)


def test_a_replay_does_not_depend_on_where_it_is_called(panoramas, replayed, tmp_path):
    elsewhere = tmp_path / "deep" / "er"
    elsewhere.mkdir(parents=True)
    relative = os.path.relpath(panoramas, elsewhere)
    result = in_process("replay", relative, *REPLAY, "--out", "../../run", cwd=elsewhere)
    assert result.returncode == 0
    same(open_run(tmp_path / "run"), replayed)
    assert digest(tmp_path / "run" / "replay.rrd") == digest(replayed.recording)


@pytest.mark.parametrize(
    ("jobs", "name"), [(1, "hash seed 0, one thread"), (2, "hash seed 1, two threads"), (2, "no time zone, no locale")]
)
def test_an_ablation_does_not_depend_on_processes_or_the_environment(panoramas, ablated, tmp_path, jobs, name):
    environment = os.environ | CIRCUMSTANCES[name]
    arguments = ("ablate", panoramas, *GRID, "--keep-steps", "--jobs", jobs, "--out", "out")
    code, _, err = run(tmp_path, *arguments, env=environment, prepare=SHUFFLED)
    assert (code, err) == (0, "")
    assert table_hash(tmp_path / "out") == table_hash(ablated)
    for trace in sorted((ablated / "steps").iterdir()):
        ours = pl.read_parquet(tmp_path / "out" / "steps" / trace.name)
        assert content_hash(ours) == content_hash(pl.read_parquet(trace))


def test_the_past_does_not_depend_on_the_future(panoramas, replayed, tmp_path):
    for limit in random.Random(7).sample(range(10, len(replayed.steps)), 8):
        out = f"first-{limit}"
        result = in_process("replay", panoramas, *REPLAY, "--no-rrd", "--limit", limit, "--out", out, cwd=tmp_path)
        assert result.returncode == 0
        steps = at_the_step(open_run(tmp_path / out).steps)
        assert len(steps) == limit
        assert content_hash(steps) == content_hash(at_the_step(replayed.steps.head(limit)))


def test_diff_says_equal_and_gives_the_hash(panoramas, replayed, tmp_path):
    assert in_process("replay", panoramas, *REPLAY, "--no-rrd", "--out", "run", cwd=tmp_path).returncode == 0
    said = in_process("diff", replayed.folder, "run", "--json", cwd=tmp_path)
    content = json.loads(said.stdout)
    assert content["equal"] is True
    assert content["content_hashes"] == [replayed.content_hash] * 2
