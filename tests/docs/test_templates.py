"""The templates of CONTRIBUTING.md keep the contracts they name, and can be replayed with as they are."""

import inspect
import runpy

import pytest

from tests.cli.test_cli import in_process
from tests.docs.pages import ROOT

TEMPLATES = ROOT / "docs" / "templates"


@pytest.mark.parametrize("name", ["dataset", "descriptor", "mapper", "metric"])
def test_a_template_passes_its_own_tests(name, tmp_path):
    inside = runpy.run_path(str(TEMPLATES / f"{name}.py"))
    tests = [one for word, one in inside.items() if word.startswith("test_")]
    assert tests
    for test in tests:
        test(**{"tmp_path": tmp_path} if "tmp_path" in inspect.signature(test).parameters else {})


def test_there_are_no_other_templates():
    assert sorted(path.stem for path in TEMPLATES.iterdir() if path.suffix) == [
        "dataset",
        "descriptor",
        "mapper",
        "metric",
    ]


@pytest.mark.parametrize(
    ("option", "name", "setting"), [("--mapper", "mapper", "reach=0.1"), ("--descriptor", "descriptor", "bands=16")]
)
def test_a_template_replays_and_explains(option, name, setting, panoramas, tmp_path):
    component = f"{TEMPLATES / name}.py:My{name.capitalize()}"
    made = in_process(
        "replay", f"folder:{panoramas}", option, component, "--set", setting, "--no-rrd", "--limit", 40, cwd=tmp_path
    )
    assert made.returncode == 0, made.stderr
    folder = made.stdout.splitlines()[0]
    assert f"my-{name}" in folder
    explained = in_process("explain", folder, 39, cwd=tmp_path)
    assert explained.returncode == 0, explained.stderr
    assert "decision" in explained.stdout
