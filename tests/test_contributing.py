"""What is there for contributors can be read, and names commands, files and tests that exist."""

import re
import runpy
import shlex
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import pytest
import yaml

from omnieval.cli import app

ROOT = Path(__file__).parents[1]
GITHUB = ROOT / ".github"
WORKFLOWS = sorted((GITHUB / "workflows").glob("*.yml"))
FORMS = sorted((GITHUB / "ISSUE_TEMPLATE").glob("[!c]*.yml"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
SHELL = {"if", "rm", "cd", "git", "sed", "gh", "fresh/bin/pip"}
"""What is not a program of Python's, and there on every machine that runs it."""
TOOLS = {"pytest": "pytest", "ruff": "ruff", "mypy": "mypy", "mkdocs": "mkdocs", "lint-imports": "import-linter"}
"""Programs, and the requirement of an extra that brings them."""


def read(path):
    # The key `on` of a workflow is the word true to YAML 1.1.
    return yaml.safe_load(path.read_text("utf-8"))


def commands_of(path):
    """Return the lines that a workflow runs, with the name of the job."""
    for name, job in read(path)["jobs"].items():
        for step in job["steps"]:
            assert ("run" in step) != ("uses" in step), (path.name, name, step)
            for line in step.get("run", "").splitlines():
                yield from ((name, part.strip()) for part in line.split("&&"))


def made_of(text):
    """Return the recipes of a Makefile, variables written out."""
    values = {"PYTHON": "python3", "BIN": ".venv/bin", "TESTS": "", "PROCESSES": "2", "MAKEFILE_LIST": "Makefile"}
    values["PARALLEL"] = "-n 2 --dist loadfile"
    for line in text.splitlines():
        if line.startswith("\t"):
            yield re.sub(r"\$\((\w+)\)", lambda found: values[found[1]], line.strip().removeprefix("@"))


def check_command(line):
    """Check that a command, its tests and its extras exist."""
    words = shlex.split(re.sub(r"\$\{?\w+\}?", "x", line), comments=True)
    while "=" in words[0]:  # of the environment
        words = words[1:]
    program = words[0].removeprefix(".venv/bin/").removeprefix(".venv-oldest/bin/")
    if program in {"python", "python3"} and words[1:2] == ["-m"]:
        program, words = words[2], words[2:]
    for word in words[1:]:
        if word.startswith("tests/") or word.endswith((".py", ".toml", ".txt")):
            assert (ROOT / word).exists(), (line, word)
        for extra in re.findall(r"\.\[([\w,]+)\]", word):
            assert set(extra.split(",")) <= set(PROJECT["optional-dependencies"]), line
    if program == "omnieval" or program.endswith("/omnieval"):
        assert words[1] in {
            one.name or getattr(one.callback, "__name__", "").strip("_") for one in app.registered_commands
        }, line
    elif program in TOOLS:
        extras = [one for extra in PROJECT["optional-dependencies"].values() for one in extra]
        assert any(one.startswith(TOOLS[program]) for one in extras), line
    elif program not in {"python", "python3", "pip", "venv", "build", "twine", "pre-commit", "fresh/bin/pip"}:
        assert program in SHELL, line


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_runs_what_exists(path):
    workflow = read(path)
    assert {"name", True, "permissions", "jobs"} <= set(workflow)
    lines = list(commands_of(path))
    assert lines
    for _, line in lines:
        check_command(line)
    for name, job in workflow["jobs"].items():
        needs = job.get("needs", [])
        assert {needs} if isinstance(needs, str) else set(needs) <= set(workflow["jobs"]), name


def test_every_python_is_tested_that_the_project_says_it_takes():
    (tests,) = [read(path) for path in WORKFLOWS if path.stem == "tests"]
    matrix = tests["jobs"]["quick"]["strategy"]["matrix"]
    said = [one.rsplit(" ", 1)[1] for one in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", one)]
    assert matrix["python"] == said
    assert PROJECT["requires-python"] == f">={said[0]}"
    assert {name.partition("-")[0] for name in matrix["os"]} == {"ubuntu", "macos", "windows"}


def test_make_check_runs_every_part_that_ci_runs():
    text = (ROOT / "Makefile").read_text("utf-8")
    recipes = list(made_of(text))
    for line in recipes:
        check_command(line.removeprefix("if test -d .git; then ").removesuffix("; fi"))
    parts = re.search(r"^check: ([a-z ]+?)  ##", text, re.MULTILINE)
    assert parts is not None
    targets = set(re.findall(r"^([a-z]+):", text, re.MULTILINE))
    assert set(parts[1].split()) <= targets
    assert f".PHONY: {' '.join(re.findall(r'^([a-z]+):', text, re.MULTILINE))}\n" in text
    ci = (ROOT / ".ci" / "run").read_text("utf-8")
    markers = set(re.findall(r"-m (slow|faults|browser)", ci))
    assert markers == set(re.findall(r"-m (slow|faults|browser)", "\n".join(recipes)))
    for tool in ("ruff", "mypy", "lint-imports", "omnieval check --reference runs/reference/synthetic.toml"):
        assert any(f"/{tool}" in line for line in recipes), tool


def test_what_git_checks_before_a_commit_is_installed_with_the_tools():
    hooks = [hook for repo in read(ROOT / ".pre-commit-config.yaml")["repos"] for hook in repo["hooks"]]
    assert hooks
    scripts = {one.name for one in entry_points(group="console_scripts")}
    for hook in hooks:
        assert hook["language"] == "system"
        words = hook["entry"].split()
        assert words[2] in TOOLS if words[:2] == ["python", "-m"] else words[0] in scripts | set(TOOLS)


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.name)
def test_a_form_for_issues_is_complete(path):
    form = read(path)
    assert {"name", "description", "body"} <= set(form)
    names = [field["id"] for field in form["body"]]
    assert len(names) == len(set(names))
    assert all(field["attributes"]["label"] for field in form["body"])
    if path.stem != "idea":
        doctor = next(field for field in form["body"] if field["id"] == "doctor")
        assert "omnieval doctor" in doctor["attributes"]["label"]
        assert doctor["validations"]["required"]


def test_release_notes_are_the_section_of_the_version():
    notes = runpy.run_path(str(GITHUB / "release_notes.py"))["notes"]
    log = "# Changelog\n\n## [2.0.0] 2026-12-31\n\n### Added\n\n- More.\n\n## [1.0.0] (unreleased)\n\n- Less.\n"
    assert notes("v2.0.0", "2.0.0", log) == "### Added\n\n- More.\n"
    for tag, version, words in (
        ("v1.9.0", "2.0.0", "tag v2.0.0"),
        ("v3.0.0", "3.0.0", r"no section \[3.0.0\]"),
        ("v1.0.0", "1.0.0", "put the date"),
    ):
        with pytest.raises(SystemExit, match=words):
            notes(tag, version, log)
    real = (ROOT / "CHANGELOG.md").read_text("utf-8").replace("(unreleased)", "2026-12-31")
    assert "### Added" in notes(f"v{PROJECT['version']}", PROJECT["version"], real)
