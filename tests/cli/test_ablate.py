"""``omnieval ablate`` as its users meet it."""

import json
import shutil

import polars as pl
import pytest

from tests.cli.test_cli import fails, in_process

SMALL = ("--set", "n_init=10", "--set", "n_new=10", "--set", "gamma=1")
SWEEP = ("--vary", "omega=2.5,3.5", "--vary", "merge_y=0.5:4.5:2")


def test_a_sweep_writes_its_table_and_says_what_it_came_to(panoramas, tmp_path):
    result = in_process("ablate", panoramas, *SMALL, *SWEEP, "--jobs", 2, "--csv", "--out", "out", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    folder, header, *_ = result.stdout.splitlines()
    assert folder == "out"
    for word in ("silhouette", "median_silhouette", "omega", "merge_y", "batch_silhouette"):
        assert word in header
    table = pl.read_parquet(tmp_path / "out" / "ablation.parquet")
    assert len(table) == 6
    best = max(table["silhouette"].to_list())
    assert f"{best:.4f}" in result.stdout
    assert (tmp_path / "out" / "ablation.csv").exists()


def test_a_failing_job_is_a_row_and_exit_code_5(panoramas, tmp_path):
    # A folder where a decision trace should go makes its job fail, and no other.
    arguments = ("ablate", panoramas, *SMALL, "--vary", "omega=2.5,3.5", "--keep-steps", "--out", "out")
    assert in_process(*arguments, cwd=tmp_path).returncode == 0
    (trace,) = (tmp_path / "out" / "steps").glob("00001-*.parquet")
    trace.unlink()
    trace.mkdir()
    (tmp_path / "out" / "parts" / f"{trace.stem}.json").unlink()
    failed = in_process(*arguments, "--resume", cwd=tmp_path)
    assert failed.returncode == 5
    assert "1 of 2 jobs failed" in failed.stderr
    rows = pl.read_parquet(tmp_path / "out" / "ablation.parquet")
    assert rows["error"][0] is None
    assert "cannot write" in rows["error"][1]
    assert rows["silhouette"][1] is None
    assert rows["omega"].to_list() == [2.5, 3.5]
    assert "failed, will run again" in in_process(*arguments, "--dry-run", cwd=tmp_path).stdout
    fails(in_process(*arguments, "--resume", "--fail-fast", cwd=tmp_path), 5, "job 1 of", "--resume")
    trace.rmdir()
    assert in_process(*arguments, "--resume", cwd=tmp_path).returncode == 0
    assert pl.read_parquet(tmp_path / "out" / "ablation.parquet")["error"].null_count() == 2


def test_a_dry_run_lists_the_jobs_and_does_nothing(panoramas, tmp_path):
    result = in_process("ablate", panoramas, *SMALL, *SWEEP, "--out", "out", "--dry-run", cwd=tmp_path)
    assert result.returncode == 0
    *jobs, last = result.stdout.splitlines()
    assert last == "6 jobs, 0 done"
    assert all(job.endswith("not started") for job in jobs)
    assert "omega=3.5 merge_y=0.5" in jobs[3]
    assert list(tmp_path.iterdir()) == []
    listed = in_process("ablate", panoramas, *SMALL, *SWEEP, "--dry-run", "--json", cwd=tmp_path)
    assert [row["merge_y"] for row in json.loads(listed.stdout)["jobs"]] == [0.5, 2.5, 4.5] * 2


def test_a_preset_brings_the_papers_axes(panoramas, tmp_path):
    presets = ("--preset", "table-2", "--preset", "paper-literal")
    result = in_process("ablate", panoramas, *presets, "--descriptor", "hog", "--dry-run", cwd=tmp_path)
    assert result.stdout.splitlines()[-1] == "35 jobs, 0 done"


def test_json_is_one_object(panoramas, tmp_path):
    result = in_process("ablate", panoramas, *SMALL, "--vary", "omega=3.5", "--json", cwd=tmp_path)
    content = json.loads(result.stdout)
    assert content["rows"][0]["omega"] == 3.5
    assert content["summary"][0]["silhouette"] == content["rows"][0]["silhouette"]
    assert (tmp_path / content["ablation"] / "ablation.parquet").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["{panoramas}", "--vary", "omga=1,2", "--vary", "n_new=x"], 2, ["did you mean omega?", "'x'"]),
        (["{panoramas}", "--vary", "omega"], 2, ["NAME=VALUES"]),
        (["{panoramas}", "--vary", "omega=1,2", "--set", "omega=1"], 2, ["both varied"]),
        (["{panoramas}", "--descriptor", "hog,gits"], 2, ["did you mean gist?"]),
        (["{panoramas}", "--preset", "table-4"], 2, ["unknown preset", "table-"]),
        (["{panoramas}", "--preset", "table-2", "--preset", "table-3"], 2, ["at most one"]),
        (["{panoramas}", "--rrd", "all"], 2, ["the only choice is best"]),
        (["{panoramas}", "--axes", "none.toml"], 2, ["cannot read axes none.toml"]),
        (["nowhere", "elsewhere"], 3, ["nowhere", "elsewhere"]),
    ],
)
def test_every_slip_gets_one_line_and_its_exit_code(arguments, code, words, panoramas, tmp_path):
    fails(in_process("ablate", *(part.format(panoramas=panoramas) for part in arguments), cwd=tmp_path), code, *words)
    assert list(tmp_path.iterdir()) == []


def test_a_bad_image_is_refused_before_anything_is_written_or_left_out_and_counted(panoramas, tmp_path):
    folder = shutil.copytree(panoramas, tmp_path / "images")
    bad = sorted(folder.glob("*.png"))[40]
    bad.write_bytes(b"")
    arguments = ("ablate", folder, *SMALL, "--vary", "omega=2.5,3.5", "--out", "out")
    fails(in_process(*arguments, cwd=tmp_path), 3, bad.name)
    assert not (tmp_path / "out").exists()
    assert in_process(*arguments, "--skip-bad", cwd=tmp_path).returncode == 0
    manifest = json.loads((tmp_path / "out" / "run.json").read_text())
    assert list(manifest["grid"]["skipped"].values()) == [[bad.name]]
    assert in_process(*arguments, "--skip-bad", "--resume", cwd=tmp_path).returncode == 0


def test_options_are_checked_before_sources(tmp_path):
    fails(in_process("ablate", "nowhere", "--jobs", 0, cwd=tmp_path), 2, "--jobs")
    fails(in_process("ablate", "nowhere", "--exact", "gamma=1:2", "--keep-steps", cwd=tmp_path), 2, "--exact")


def test_an_interval_of_a_threshold(panoramas, tmp_path):
    result = in_process("ablate", panoramas, *SMALL, "--exact", "merge_y=0.5:1000", "--out", "out", cwd=tmp_path)
    assert result.returncode == 0
    _, header, *_ = result.stdout.splitlines()
    assert "exact_from" in header
    assert len(pl.read_parquet(tmp_path / "out" / "ablation.parquet")) >= 1
