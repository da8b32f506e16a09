"""``omnieval baseline`` as its users meet it."""

import json

import pytest

from omnieval.cli.baseline import parse_ks
from omnieval.results.schemas import SCHEMA_VERSION
from tests.cli.test_cli import SMALL, fails, in_process


@pytest.mark.parametrize(("text", "ks"), [("2:5", [2, 3, 4, 5]), ("7", [7]), ("5, 9,20", [5, 9, 20]), ("3:3", [3])])
def test_numbers_of_clusters_are_a_range_or_a_list(text, ks):
    assert parse_ks(text) == ks


def test_a_folder_of_its_own_for_each_and_an_aligned_table(panoramas, tmp_path):
    arguments = ("baseline", panoramas, "--method", "kmeans", "--k", "3,12")
    first, second = in_process(*arguments, cwd=tmp_path), in_process(*arguments, cwd=tmp_path)
    assert (first.returncode, first.stderr) == (0, "")
    folder, header, *rows = first.stdout.splitlines()
    assert folder.endswith("-hog-kmeans")
    assert second.stdout.splitlines()[0] == folder + "-2"
    assert (tmp_path / folder / "baseline.parquet").exists()
    assert header.split()[:3] == ["k", "nodes", "silhouette"]
    assert [row.split()[0] for row in rows] == ["3", "12"]
    assert {len(row) for row in rows} == {len(header)}


def test_json_is_one_object_with_all_rows(panoramas, tmp_path):
    result = in_process("baseline", panoramas, "--k", "2:4", "--similarity", "knn", "--json", cwd=tmp_path)
    content = json.loads(result.stdout)
    assert (content["schema_version"], content["status"]) == (SCHEMA_VERSION, "complete")
    assert content["baseline"] == {"method": "spectral", "similarity": "knn", "ks": [2, 3, 4], "at_k_of": None}
    assert [row["k"] for row in content["rows"]] == [2, 3, 4]
    assert content["rows"][1]["rooms_ari"] == 1.0


def test_archives_and_the_nodes_of_a_run(panoramas, tmp_path):
    assert in_process("describe", panoramas, "--out", "three.npz", cwd=tmp_path).returncode == 0
    run = json.loads(in_process("map", "three.npz", *SMALL, "--json", cwd=tmp_path).stdout)
    arguments = ("baseline", "three.npz", "--at-k-of", run["run"], "--json")
    (row,) = json.loads(in_process(*arguments, cwd=tmp_path).stdout)["rows"]
    assert row["k"] == run["metrics"]["nodes"]


def test_what_has_no_value_says_why(panoramas, tmp_path):
    bare = tmp_path / "bare"
    bare.mkdir()
    for number in range(12):
        name = f"image{number}.png"
        (bare / name).write_bytes((panoramas / name).read_bytes())
    result = in_process("baseline", "bare", "--k", "2", cwd=tmp_path)
    assert "silhouette: the sequence has no poses" in result.stdout
    assert "rooms_ari: the sequence has no room labels" in result.stdout


def test_settings_cuts_and_seed_are_those_of_a_replay(panoramas, tmp_path):
    arguments = ["--set", "hog.bins=8", "--set", "seed=3", "--start", "16", "--limit", "32", "--k", "2"]
    content = json.loads(in_process("baseline", panoramas, *arguments, "--json", cwd=tmp_path).stdout)
    assert content["frames"] == 32
    assert content["descriptor"]["settings"]["bins"] == 8
    assert content["seed"] == 3
    assert content["rows"][0]["rooms_ari"] == 1.0


def test_help_shows_examples(tmp_path):
    page = in_process("baseline", "--help", cwd=tmp_path)
    assert page.returncode == 0
    assert "Examples" in page.stdout
    for name in ("spectral", "kmeans", "agglomerative", "dbstream", "time-slices", "positions", "rooms"):
        assert name in "".join(page.stdout.split())


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["{panoramas}", "--method", "kmean"], 2, ["unknown method", "did you mean kmeans"]),
        (["{panoramas}", "--similarity", "nearest"], 2, ["unknown similarity", "knn"]),
        (["{panoramas}", "--k", "40:2"], 2, ["--k '40:2'", "2:40"]),
        (["{panoramas}", "--k", "many"], 2, ["--k 'many'"]),
        (["{panoramas}", "--k", "0"], 2, ["1 or more"]),
        (["{panoramas}", "--k", "100"], 2, ["100 clusters", "there are 80"]),
        (["{panoramas}", "--method", "rooms", "--k", "3"], 2, ["takes no number of clusters"]),
        (["{panoramas}", "--at-k-of", "nothing"], 2, ["not a run folder"]),
        (["{panoramas}", "--descriptor", "hogg"], 2, ["unknown descriptor"]),
        (["none.npz"], 3, ["none.npz"]),
        (["none.npz", "--descriptor", "gist"], 2, ["none.npz holds descriptors already"]),
        (["nowhere"], 3, ["nowhere"]),
    ],
)
def test_every_slip_gets_one_line_and_its_exit_code(arguments, code, words, panoramas, tmp_path):
    fails(in_process("baseline", *(part.format(panoramas=panoramas) for part in arguments), cwd=tmp_path), code, *words)
    assert list(tmp_path.iterdir()) == []
