"""``omnieval compare`` writes one table in the form that is asked for."""

import csv
import io
import json

import polars as pl
import pytest

from omnieval.results.run_folder import open_run
from omnieval.results.schemas import SCHEMA_VERSION
from tests.cli.test_cli import fails, in_process


def compare(cwd, *arguments):
    result = in_process("compare", "a", "b", *arguments, cwd=cwd)
    assert (result.returncode, result.stderr) == (0, "")
    return result.stdout


def test_the_table_has_a_column_a_run_and_a_row_a_metric(two_runs):
    rows = {line.split()[0]: line.split()[1:] for line in compare(two_runs).splitlines()}
    assert rows["run"] == ["a", "b"]
    assert rows["gamma"] == ["1.0", "20.0"]
    metrics = [open_run(two_runs / name).metrics for name in "ab"]
    assert rows["rooms_purity"] == [f"{one['rooms_purity']:.4f}" for one in metrics]
    assert rows["silhouette"][1] == "-"  # one node only
    assert set(metrics[0]) <= set(rows)
    assert "omega" not in rows


def test_what_all_runs_share_is_said_once(two_runs):
    (source,) = (line for line in compare(two_runs).splitlines() if line.startswith("source"))
    assert source.count("folder:") == 1


def test_csv_reads_back_exactly(two_runs):
    rows = list(csv.DictReader(io.StringIO(compare(two_runs, "--format", "csv"))))
    assert [row["run"] for row in rows] == ["a", "b"]
    for row in rows:
        assert float(row["share_retest"]) == open_run(two_runs / row["run"]).metrics["share_retest"]


def test_markdown_has_a_row_a_run(two_runs):
    header, rule, *rows = compare(two_runs, "--format", "md").splitlines()
    assert header.startswith("| run ")
    assert set(rule) <= set("|-:")
    assert [row.split("|")[1].strip() for row in rows] == ["a", "b"]
    assert {line.count("|") for line in (header, rule, *rows)} == {header.count("|")}


def test_latex_is_a_booktabs_table_of_the_columns_that_are_asked_for(two_runs):
    columns = "gamma,omega,nodes,share_assigned"
    text = compare(two_runs, "--format", "latex", "--columns", columns)
    first, *lines, last = (" ".join(line.split()) for line in text.splitlines())
    assert (first, last) == (r"\begin{tabular}{lllrr}", r"\end{tabular}")
    assert lines[1] == r"run & gamma & omega & nodes & share\_assigned \\"
    metrics = open_run(two_runs / "b").metrics
    assert lines[4] == rf"b & 20.0 & 3.5 & {metrics['nodes']} & {metrics['share_assigned']:.4f} \\"


def test_json_is_the_same_by_either_name(two_runs):
    content = compare(two_runs, "--json")
    assert compare(two_runs, "--format", "json") == content
    assert [run["run"] for run in json.loads(content)["runs"]] == ["a", "b"]


def test_a_single_run_makes_a_table_too(two_runs):
    result = in_process("compare", "a", cwd=two_runs)
    assert result.stdout.startswith("run  ")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["a", "b", "--columns", "silhuette"], ["silhuette", "did you mean silhouette"]),
        (["a", "b", "--format", "html"], ["--format", "html"]),
        (["a", "nothing"], ["nothing is not a run folder"]),
        ([], ["RUN"]),
    ],
)
def test_every_slip_gets_one_line_and_exit_code_2(two_runs, arguments, words):
    fails(in_process("compare", *arguments, cwd=two_runs), 2, *words)


def other_results(folder, kind):
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps({"schema_version": SCHEMA_VERSION, "kind": kind}))
    return folder


def test_other_results_are_left_out_and_named(two_runs, tmp_path):
    others = [other_results(tmp_path / f"an-{kind}", kind) for kind in ("ablation", "baseline")]
    result = in_process("compare", others[0], "a", others[1], tmp_path, "--json", cwd=two_runs)
    assert result.returncode == 0
    assert [row["run"] for row in json.loads(result.stdout)["runs"]] == ["a"]
    (line,) = result.stderr.splitlines()
    named = f"{others[0]} (ablation), {others[1]} (baseline), {tmp_path} (no results)"
    assert line == f"omnieval: only replays are compared; left out: {named}"
    fails(in_process("compare", *others, cwd=two_runs), 2, f"{others[0]} is an ablation, not a replay")
    fails(in_process("compare", "a", tmp_path / "b", cwd=two_runs), 2, f"{tmp_path / 'b'} is not a run folder")


def methods(cwd, *arguments):
    result = in_process("compare", *arguments, cwd=cwd)
    assert result.returncode == 0, result.stderr
    return result


def test_an_ablation_and_runs_are_compared_by_method(two_runs, panoramas):
    settings = ("--set", "roman2020.n_init=10", "--set", "roman2020.n_new=10")
    arguments = ("--mapper", "roman2020,leader", "--vary", "gamma=1,20", *settings, "--out", "sweep")
    assert in_process("ablate", f"folder:{panoramas}", *arguments, cwd=two_runs).returncode == 0
    content = json.loads(methods(two_runs, "sweep", "--by", "mapper", "--metric", "pair_f1,nodes", "--json").stdout)
    estimates = {(row["mapper"], row["metric"]): row for row in content["estimates"]}
    roman = estimates["roman2020", "pair_f1"]
    assert (roman["n"], roman["finished"], roman["runs"]) == (1, 2, 2)  # both gammas are runs on the same images
    rows = pl.read_parquet(two_runs / "sweep" / "ablation.parquet").filter(mapper="roman2020")
    assert roman["value"] == pytest.approx(rows["pair_f1"].mean())
    (difference,) = (row for row in content["differences"] if row["metric"] == "pair_f1")
    assert difference["value"] == pytest.approx(roman["value"] - estimates["leader", "pair_f1"]["value"])
    (ranks,) = content["ranks"]
    assert {row["mean_rank"] for row in ranks["groups"]} == {1.0, 2.0}
    both = json.loads(methods(two_runs, "sweep", "a", "--by", "mapper,run", "--metric", "nodes", "--json").stdout)
    assert [row["runs"] for row in both["estimates"]] == [2, 1, 1]


def test_the_tables_of_methods_are_text(two_runs):
    result = methods(two_runs, "a", "b", "--by", "gamma", "--metric", "share_assigned")
    header, rule, one, other, *_ = result.stdout.splitlines()
    assert header.split()[1:-1:2] == ["metric", "gamma", "estimate", "low", "high", "n", "over", "finished"]
    assert {line.count("|") for line in (rule, one, other)} == {header.count("|")}
    assert "an interval needs 5 cases or more" in result.stderr
    csv_ = methods(two_runs, "a", "b", "--metric", "nodes", "--format", "csv").stdout
    assert [row["n"] for row in csv.DictReader(io.StringIO(csv_))] == ["1"]
    latex = methods(two_runs, "a", "b", "--metric", "nodes", "--format", "latex").stdout
    assert latex.startswith(r"\begin{tabular}")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["a", "--by", "maper"], ["maper", "did you mean mapper"]),
        (["a", "--metric", "silhuette"], ["silhuette", "did you mean silhouette"]),
        (["a", "a", "--metric", "nodes"], ["a is named twice"]),
        (["a", "--metric", "nodes", "--columns", "nodes"], ["--columns", "--metric"]),
        (["a", "--metric", "nodes,nodes"], ["nodes is named twice"]),
    ],
)
def test_slips_of_comparing_methods_get_one_line(two_runs, arguments, words):
    fails(in_process("compare", *arguments, cwd=two_runs), 2, *words)
