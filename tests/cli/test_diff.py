"""``omnieval diff`` names where two runs part, shows both decisions, and counts where they agree."""

import json

import pytest

from omnieval.recording.viewer import check_recording
from omnieval.results.compare import agreement
from omnieval.results.run_folder import open_run
from tests.cli.test_cli import SMALL, fails, in_process


@pytest.fixture(scope="module")
def agreed(two_runs):
    return agreement(open_run(two_runs / "a"), open_run(two_runs / "b"))


def test_both_decisions_of_the_first_step_that_parts_are_shown(two_runs, agreed):
    result = in_process("diff", "a", "b", cwd=two_runs)
    assert (result.returncode, result.stderr) == (0, "")
    assert f"step {agreed.first_parted} is the first with another verdict or another partition" in result.stdout
    mine, theirs = result.stdout.split("\nA: a\n")[1].split("\nB: b\n")
    assert "decision    joined node" in mine
    assert "decision    refused (prominence): prominence" in theirs
    assert "gamma  1.0 | 20.0" in theirs


def test_agreements_are_counted(two_runs, agreed):
    text = in_process("diff", "a", "b", cwd=two_runs).stdout
    for name, same in (("same verdict", agreed.verdicts), ("same partition", agreed.partitions)):
        (line,) = (line for line in text.splitlines() if line.strip().startswith(name))
        assert f" {same.sum()} of 80 steps" in line
    assert f"adjusted Rand index {agreed.final_ari:.3f}" in text
    content = json.loads(in_process("diff", "a", "b", "--json", cwd=two_runs).stdout)
    assert content["agreement"] == {
        "steps": 80,
        "same_verdict": agreed.verdicts.sum(),
        "same_partition": agreed.partitions.sum(),
        "same_both": agreed.both.sum(),
        "first_parted": agreed.first_parted,
        "final_adjusted_rand": agreed.final_ari,
    }


def test_equal_runs_agree_everywhere(two_runs):
    assert in_process("diff", "a", "a", cwd=two_runs).stdout.startswith("equal: all 80 steps\n")
    content = json.loads(in_process("diff", "a", "a", "--json", cwd=two_runs).stdout)
    assert content["equal"] is True
    assert content["agreement"]["same_both"] == 80
    assert content["agreement"]["first_parted"] is None
    assert content["agreement"]["final_adjusted_rand"] == 1.0


def test_both_runs_go_into_one_recording(two_runs, tmp_path):
    file = tmp_path / "both.rrd"
    result = in_process("diff", "a", "b", "--rrd", file, cwd=two_runs)
    assert result.returncode == 0
    assert f"omnieval view {file}" in result.stderr
    assert check_recording(file) == 80
    fails(in_process("diff", "a", "b", "--rrd", file, cwd=two_runs), 2, "both.rrd exists", "--overwrite")
    assert in_process("diff", "a", "b", "--rrd", file, "--overwrite", cwd=two_runs).returncode == 0


def test_runs_over_other_images_are_compared_as_far_as_that_goes(two_runs, panoramas, tmp_path):
    other = tmp_path / "other"
    arguments = ("replay", f"folder:{panoramas}", *SMALL, "--no-rrd", "--start", "10", "--out", other)
    assert in_process(*arguments, cwd=two_runs).returncode == 0
    assert "the runs replay different images" in in_process("diff", "a", other, cwd=two_runs).stdout
    fails(in_process("diff", "a", other, "--rrd", tmp_path / "x.rrd", cwd=two_runs), 2, "replay different images")
    assert not (tmp_path / "x.rrd").exists()


def test_a_prefix_agrees_as_far_as_it_goes(two_runs, panoramas, tmp_path):
    short = tmp_path / "short"
    arguments = ("replay", f"folder:{panoramas}", *SMALL, "--no-rrd", "--limit", "33", "--out", short)
    assert in_process(*arguments, cwd=two_runs).returncode == 0
    text = in_process("diff", "a", short, cwd=two_runs).stdout
    assert "one of the runs ends here" in text
    assert "33 of 33 steps (100.0 %)" in text
    assert "none: both runs must be complete and of equal length" in text


@pytest.mark.parametrize(("arguments", "words"), [(["a"], ["B"]), (["a", "nothing"], ["nothing is not a run folder"])])
def test_every_slip_gets_one_line_and_exit_code_2(two_runs, arguments, words):
    fails(in_process("diff", *arguments, cwd=two_runs), 2, *words)
