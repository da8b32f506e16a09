"""`omnieval doctor`: facts for a bug report, and a self-test whose failure is a line and an exit code."""

from __future__ import annotations

import json
import os
from importlib.metadata import version
from pathlib import Path

import pytest

from omnieval import doctor
from omnieval.doctor import SelfTest, examine, self_test
from tests.cli.test_cli import in_process
from tests.trust.inputs import listing, one_line


@pytest.fixture
def well(monkeypatch):
    """The self-test without its seconds."""
    monkeypatch.setattr(doctor, "self_test", lambda: SelfTest(ok=True, failure=None, facts={"frames": 40}))


def test_the_report_is_text_to_paste(well, tmp_path):
    result = in_process("doctor", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    titles = [line for line in lines if not line.startswith(" ")]
    assert titles == ["versions", "machine", "blas", "cache", "viewer", "self-test"]
    assert lines[-1] == "  ok"
    for name in ("numpy", "polars", "rerun-sdk"):
        assert any(line.split() == [name, version(name)] for line in lines)
    assert list(tmp_path.iterdir()) == []


def test_the_report_is_one_object_as_json(well, tmp_path):
    content = json.loads(in_process("doctor", "--json", cwd=tmp_path).stdout)
    assert content["schema_version"] == 1
    assert content["ok"] is True
    assert content["versions"]["omnieval"] == version("omnieval")
    assert not {"pytest", "ruff"} & set(content["versions"])
    assert content["self_test"] == {"ok": True, "failure": None, "facts": {"frames": 40}}
    assert any("blas" in name for name in content["blas"])


def test_the_home_folder_is_not_told(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("OMNIEVAL_CACHE", str(tmp_path / ".cache" / "mine"))
    sections = examine().sections
    assert sections["cache"]["folder"] == str(Path("~/.cache/mine"))
    assert str(tmp_path) not in json.dumps(sections)


@pytest.mark.parametrize(
    ("child", "failure"),
    [
        ("import os; os.abort()", "without a word (signal 6)"),
        ("raise SystemExit('no luck')", "no luck"),
        ("import sys; print('some noise', file=sys.stderr); 1 / 0", "ZeroDivisionError: division by zero"),
    ],
)
def test_a_self_test_that_fails_is_a_line_and_exit_code_1(child, failure, monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "_CHILD", child)
    result = in_process("doctor", cwd=tmp_path)
    assert result.returncode == 1
    assert result.stdout.splitlines()[-1] == f"  failed: {failure}"
    one_line(result.stderr, "the self-test failed", failure, "report it")
    reported = in_process("doctor", "--json", cwd=tmp_path)
    assert reported.returncode == 1
    assert json.loads(reported.stdout)["self_test"] == {"ok": False, "failure": failure, "facts": {}}


def test_a_self_test_that_does_not_end_is_ended(monkeypatch):
    monkeypatch.setattr(doctor, "_CHILD", "import threading; threading.Event().wait()")
    monkeypatch.setattr(doctor, "_PATIENCE_S", 0.5)
    assert self_test().failure == "it did not end within 0.5 s"


@pytest.mark.slow
def test_the_self_test_passes_and_leaves_nothing(monkeypatch, tmp_path):
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setenv("OMNIEVAL_CACHE", str(tmp_path / "cache"))
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr("tempfile.tempdir", None)
    tested = self_test()
    assert (tested.ok, tested.failure) == (True, None)
    assert tested.facts["frames"] == 40
    assert tested.facts["nodes"] >= 1
    assert len(tested.facts["decisions"]) == 16
    assert list(listing(tmp_path)) == ["tmp"]


def test_the_cache_is_told(monkeypatch, tmp_path):
    monkeypatch.setenv("OMNIEVAL_CACHE", str(tmp_path / "none"))
    told = examine().cache
    assert (told["writable"], told["descriptions"], told["integrity"]) == ("yes", "0", "empty")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="a script stands in for the viewer")
class TestViewer:
    @pytest.fixture
    def rerun(self, tmp_path, monkeypatch):
        def install(script: str) -> None:
            path = tmp_path / "rerun"
            path.write_text(f"#!/bin/sh\n{script}\n")
            path.chmod(0o755)
            monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")

        return install

    def test_one_that_fits(self, rerun):
        rerun(f"echo rerun-cli {version('rerun-sdk')} built today")
        assert examine().viewer["rerun"].endswith(f"/rerun {version('rerun-sdk')}, as is rerun-sdk")

    def test_one_that_does_not(self, rerun):
        rerun("echo rerun-cli 0.1.2")
        assert f"0.1.2, but rerun-sdk is {version('rerun-sdk')}" in examine().viewer["rerun"]

    def test_one_that_is_none(self, rerun):
        rerun("exit 3")
        assert "of unknown version" in examine().viewer["rerun"]

    def test_none_on_the_path(self, monkeypatch, tmp_path):
        monkeypatch.setenv("PATH", str(tmp_path))
        assert examine().viewer["rerun"].startswith("not on PATH")
