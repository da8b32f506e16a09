"""``omnieval explain`` as its users meet it."""

import json

import pytest

from omnieval.results.run_folder import open_run
from tests.cli.test_cli import fails, in_process


@pytest.fixture(scope="module")
def refused(two_runs):
    """The first step of run b that was refused for its prominence."""
    verdicts = open_run(two_runs / "b").steps["verdict"].to_list()
    return verdicts.index("prominence")


def test_a_recording_and_a_run_folder_in_place_of_the_other_are_answered_with_the_right_one(two_runs):
    result = in_process("explain", "a/replay.rrd", 3, cwd=two_runs)
    assert (result.returncode, "it is a file; name the folder, a" in result.stderr) == (2, True)
    result = in_process("replay", "a", cwd=two_runs)
    assert (result.returncode, f"omnieval view {two_runs / 'a'}" in result.stderr) == (3, True)


def test_a_refusal_is_explained_in_words_and_numbers(two_runs, refused):
    result = in_process("explain", "b", refused, cwd=two_runs)
    assert (result.returncode, result.stderr) == (0, "")
    step = open_run(two_runs / "b").steps.row(refused, named=True)
    head = f"step {refused} of b (0 to 79)\n  decision    refused (prominence): prominence over the mean "
    assert result.stdout.startswith(head)
    for words in (
        f"image       {refused}: image{refused}.png, in {step['room']}, at (",
        "node        gate ratio <= x = max(omega 3.5, ",
        f"best match  {step['best_frame']} of node ",
        "< gamma 20: refused",
        "would pass this gate",
        f"final map   node {step['node_final']}, {step['placement']}: ",
    ):
        assert words in result.stdout


def test_a_file_name_explains_the_same_step(two_runs, refused):
    by_number = in_process("explain", "b", refused, cwd=two_runs).stdout
    assert in_process("explain", "b", f"image{refused}.png", cwd=two_runs).stdout == by_number


def test_json_holds_every_number(two_runs, refused):
    content = json.loads(in_process("explain", "b", refused, "--json", cwd=two_runs).stdout)
    step = open_run(two_runs / "b").steps.row(refused, named=True)
    assert (content["schema_version"], content["run"], content["step"]) == (1, "b", refused)
    decided = content["scene"]["step"]
    for one, kept in zip(decided["comparisons"], step["comparisons"], strict=True):
        assert (one["gate"], one["values"], one["threshold"]) == (kept["gate"], kept["values"], kept["threshold"])
    assert decided["measured"]["prominence_ratio"] == step["prominence_ratio"]
    assert (content["margin"]["value"], content["margin"]["gate"]) == (step["margin"], step["margin_gate"])
    assert content["outcome"] in {"refused", "missed"}
    (flip,) = (flip for flip in content["flips"] if flip["gate"] == "prominence")
    assert (flip["parameter"], flip["needed"], flip["passed"]) == ("gamma", step["prominence_ratio"], False)
    assert (content["node_final"], content["placement"]) == (step["node_final"], step["placement"])


def test_refused_loop_closures_are_listed_with_one_to_go_on_with(two_runs):
    result = in_process("explain", "b", "--refused", "--ago", "1", "--limit", "3", cwd=two_runs)
    assert result.returncode == 0
    first, header, _, *rows, hint = result.stdout.splitlines()
    assert "refused loop closures with a true match within 1 m" in first
    assert header.split()[1:6:2] == ["step", "room", "verdict"]
    assert len(rows) == 3
    content = json.loads(
        in_process("explain", "b", "--refused", "--ago", "1", "--limit", "3", "--json", cwd=two_runs).stdout
    )
    assert len(content["closures"]) == 3 < content["refused"]
    assert hint == f"explain one: omnieval explain b {content['closures'][0]['step']}"
    assert in_process(*hint.split()[3:], cwd=two_runs).returncode == 0


def test_a_run_that_refused_nothing_it_should_not_have_says_so(two_runs):
    result = in_process("explain", "b", "--refused", "--within", "0", cwd=two_runs)
    assert result.stdout == "0 refused loop closures with a true match within 0 m, nearest to passing first\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["b", "80"], ["no step 80", "0 to 79"]),
        (["b", "image80.png"], ["no image image80.png", "did you mean"]),
        (["b"], ["a STEP", "--refused"]),
        (["b", "3", "--refused"], ["a STEP", "--refused"]),
        (["nothing", "3"], ["nothing is not a run folder"]),
        (["b", "--refused", "--limit", "0"], ["--limit"]),
    ],
)
def test_every_slip_gets_one_line_and_exit_code_2(two_runs, arguments, words):
    fails(in_process("explain", *arguments, cwd=two_runs), 2, *words)


def test_the_help_shows_examples(two_runs):
    page = in_process("explain", "--help", cwd=two_runs)
    assert page.returncode == 0
    assert "omnieval explain runs/synthetic-cloudy-hog --refused" in page.stdout
