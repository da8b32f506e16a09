"""``omnieval check`` as its users and their CI meet it."""

import json
import re
import shutil
from xml.etree import ElementTree as ET

import pytest

from omnieval.regression.reference import read_reference
from tests.cli.test_cli import SMALL, fails, in_process


@pytest.fixture
def cwd(panoramas, tmp_path):
    """A working directory with a reference of one case."""
    made = in_process("check", f"folder:{panoramas}", *SMALL, "--reference", "ref/three.toml", "--update", cwd=tmp_path)
    assert (made.returncode, made.stderr) == (0, "")
    assert made.stdout.startswith("ref/three.toml\n  three-places")
    assert "added\n    nodes " in made.stdout
    return tmp_path


def edit(cwd, old, new):
    path = cwd / "ref" / "three.toml"
    changed, count = re.subn(old, new, path.read_text(), count=1)
    assert count == 1
    path.write_text(changed)


def check(cwd, *arguments):
    return in_process("check", *arguments, "--reference", "ref/three.toml", cwd=cwd)


def fails_with_a_table(result, *words):
    assert result.returncode == 4
    (line,) = result.stderr.splitlines()
    assert line.startswith("omnieval: ref/three.toml is not met: ")
    for word in ("expected", "got", "difference", *words):
        assert word in result.stdout


def test_what_holds_exits_with_0_and_shows_every_value(cwd, panoramas):
    for arguments in ((), (f"folder:{panoramas}",), (panoramas, *SMALL)):
        result = check(cwd, *arguments)
        assert (result.returncode, result.stderr) == (0, "")
        rows = [line for line in result.stdout.splitlines() if line.startswith("| three-places")]
        (case,) = read_reference(cwd / "ref" / "three.toml")
        assert len(rows) == 1 + len(case.guards)
        assert all(row.rstrip("| ").endswith("ok") for row in rows)
    assert sorted(path.name for path in cwd.iterdir()) == ["ref"]


def test_a_run_folder_is_compared_as_it_is(cwd, panoramas):
    replayed = in_process("replay", panoramas, *SMALL, "--no-rrd", "--out", "mine", cwd=cwd)
    assert replayed.returncode == 0
    assert check(cwd, "mine").returncode == 0
    edit(cwd, r"silhouette = \{ value = [\d.]+", "silhouette = { value = 0.999")
    result = check(cwd, "mine")
    fails_with_a_table(result, "0.9990", "worse")
    assert "silhouette of three-places" in result.stderr


def test_a_change_of_a_parameter_fails_and_names_the_step(cwd):
    edit(cwd, r"gamma = 1\.0\n", "gamma = 20.0\n")
    result = check(cwd)
    fails_with_a_table(result, "is the first that differs", "gamma was 1.0 when the reference was made, is 20.0")
    assert re.search(r"expected assigned, node \d+, best match frame \d+\n +got +prominence, no node", result.stdout)


@pytest.mark.parametrize(
    ("old", "new", "code", "word"),
    [
        (r"folder:\S+\"", 'folder:gone"', 3, "no such folder"),
        (r"descriptor = \"hog\"", 'descriptor = "pig"', 2, "unknown descriptor"),
        (r"gamma = 1\.0", "gamma = true", 2, "gamma: expected a number, got true"),
    ],
)
def test_what_cannot_be_replayed_is_no_regression(cwd, old, new, code, word):
    edit(cwd, old, new)
    result = check(cwd)
    assert result.returncode == code
    (line,) = result.stderr.splitlines()
    assert line.startswith("omnieval: ref/three.toml could not be checked: ")
    assert "--update" not in line
    assert word in line
    assert word in result.stdout


def test_an_image_that_cannot_be_read_is_no_regression(cwd, panoramas):
    folder = cwd / "copy"
    shutil.copytree(panoramas, folder)
    edit(cwd, r"folder:\S+\"", 'folder:copy"')
    assert check(cwd).returncode == 0
    next(iter(sorted(folder.glob("*.png")))).write_bytes(b"no image")
    result = check(cwd)
    assert result.returncode == 3
    assert "could not be checked" in result.stderr


def test_nodes_outside_their_range_fail(cwd):
    edit(cwd, r"nodes = \{.+\}", "nodes = { value = 50, min = 49, max = 51 }")
    fails_with_a_table(check(cwd), "outside")


def test_what_has_no_case_fails(cwd, panoramas):
    fails_with_a_table(check(cwd, panoramas, *SMALL, "--set", "n_new=11"), "n_new 10 there, 11 here", "missing")
    fails_with_a_table(check(cwd, "synthetic:night"), "no case of synthetic:night", "missing")


def test_a_better_value_passes(cwd):
    edit(cwd, r"silhouette = \{ value = [\d.]+", "silhouette = { value = 0.1")
    result = check(cwd)
    assert (result.returncode, result.stderr) == (0, "")
    assert "better" in result.stdout


def test_no_reference_is_never_a_pass(tmp_path):
    result = in_process("check", "--reference", "none.toml", cwd=tmp_path)
    fails(result, 4, "there is no reference none.toml", "--update")
    fails(in_process("check", "--reference", "none.toml", "--update", cwd=tmp_path), 4, "there is no reference")
    assert in_process("check", cwd=tmp_path).returncode == 2


def test_a_faulty_reference_is_a_usage_error(cwd):
    edit(cwd, "schema_version = 2", "schema_version = 9")
    fails(check(cwd), 2, "schema version 9")


def test_json_is_one_object_also_on_failure(cwd):
    content = json.loads(check(cwd, "--json").stdout)
    assert (content["schema_version"], content["ok"]) == (1, True)
    edit(cwd, r"gamma = 1\.0\n", "gamma = 20.0\n")
    result = check(cwd, "--json")
    assert result.returncode == 4
    content = json.loads(result.stdout)
    (case,) = content["cases"]
    assert (content["ok"], case["ok"]) == (False, False)
    assert case["first_difference"]["expected"]["verdict"] == "assigned"
    assert case["first_difference"]["got"]["verdict"] == "prominence"
    assert case["parameters"] == {"gamma": {"then": 1.0, "now": 20.0}}
    values = {value["metric"]: value for value in case["values"]}
    assert values["nodes"]["difference"] == values["nodes"]["got"] - values["nodes"]["expected"]


def test_junit_is_written_on_success_and_failure(cwd):
    assert check(cwd, "--junit", "check.xml").returncode == 0
    assert ET.parse(cwd / "check.xml").getroot().findall(".//failure") == []
    edit(cwd, r"nodes = \{.+\}", "nodes = { value = 50, min = 49, max = 51 }")
    assert check(cwd, "--junit", "check.xml").returncode == 4
    (failure,) = ET.parse(cwd / "check.xml").getroot().findall(".//failure")
    assert "nodes of three-places" in failure.attrib["message"]


def test_an_update_says_what_changed_and_then_it_holds(cwd):
    edit(cwd, r"gamma = 1\.0\n", "gamma = 20.0\n")
    assert check(cwd).returncode == 4
    result = check(cwd, "--update")
    assert result.returncode == 0
    assert ": changed\n    nodes " in result.stdout
    assert "decisions differ from step " in result.stdout
    assert check(cwd).returncode == 0
    content = json.loads(check(cwd, "--update", "--json").stdout)
    assert [(change["added"], change["values"]) for change in content["changes"]] == [(False, {})]
    fails(check(cwd, "--update", "--junit", "check.xml"), 2, "--junit")
