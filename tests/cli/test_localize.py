"""``omnieval localize`` and ``explain`` of one of its answers, through the command line."""

import json

from tests.cli.test_cli import in_process


def test_from_a_run_to_one_answer_in_words(panoramas, tmp_path):
    run, found = tmp_path / "run", tmp_path / "found"
    sets = ("--set", "n_init=10", "--set", "n_new=10", "--set", "omega=3.5", "--set", "gamma=1")
    assert in_process("replay", panoramas, *sets, "--no-rrd", "--out", run, cwd=tmp_path).returncode == 0
    done = in_process("localize", run, panoramas, "--stride", "8", "--out", found, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, *table = done.stdout.splitlines()
    assert first == str(found)
    assert [line.split("|")[2].strip() for line in table[2:]] == ["levels", "nearest", "coarse"]
    told = in_process("explain", found, "2", cwd=tmp_path).stdout
    assert told.startswith(f"query 2 of {found}, three-places")
    assert "error       0.00 m, heading off by 0.0 deg" in told
    answers = json.loads(in_process("explain", found, "2", "--json", cwd=tmp_path).stdout)["answers"]
    assert [answer["strategy"] for answer in answers] == ["levels", "nearest", "coarse"]


def test_what_cannot_be_is_one_line(panoramas, tmp_path):
    run = tmp_path / "run"
    assert in_process("replay", panoramas, "--no-rrd", "--no-map", "--out", run, cwd=tmp_path).returncode == 0
    failed = in_process("localize", run, panoramas, "--out", tmp_path / "found", cwd=tmp_path)
    assert failed.returncode == 2
    assert (
        failed.stderr
        == f"omnieval: {run} has no map: it was left out (--no-map) or the run did not end; replay it again\n"
    )
    assert not (tmp_path / "found").exists()
