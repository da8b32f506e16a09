"""What the project says about itself in several places is the same in all of them."""

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import omnieval

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_version_is_one():
    citation = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert citation is not None
    assert PROJECT["version"] == omnieval.__version__ == version("omnieval") == citation[1]


def test_the_lower_bounds_are_the_versions_tested_as_oldest():
    required = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"]]
    bounds = {re.split("[><=]", one)[0]: re.search(r">=([\d.]+)", one)[1] for one in required}  # type: ignore[index]
    pinned = dict(
        line.split("==") for line in (ROOT / ".ci" / "lowest.txt").read_text().splitlines() if not line.startswith("#")
    )
    assert bounds.keys() == pinned.keys()
    for name, bound in bounds.items():
        assert pinned[name] == bound or pinned[name].startswith(f"{bound}."), name


def test_every_public_name_is_there():
    assert all(getattr(omnieval, name) is not None for name in omnieval.__all__)
    assert set(omnieval.__all__) == set(omnieval._HOMES)


def test_the_readme_shows_the_commands_that_ci_runs():
    readme = (ROOT / "README.md").read_text()
    for marker, words in (("main command", "omnieval replay"), ("test command", "pytest")):
        command = readme.split(f"<!-- {marker} -->")[1].split("```")[1]
        assert command.startswith("sh\n")
        assert command.count("\n") == 2
        assert words in command
