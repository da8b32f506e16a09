"""`omnieval doctor`: facts for a bug report, and a self-test whose failure is a line and an exit code."""

from __future__ import annotations

import json
import os
import sqlite3
from importlib.metadata import version
from pathlib import Path

import pytest

from omnieval import doctor
from omnieval.descriptors.cache import DATABASE, DescriptorCache
from omnieval.descriptors.cache_state import cache_state
from omnieval.doctor import SelfTest, examine, self_test
from tests.cli.test_cli import in_process
from tests.trust.inputs import flip, half, listing, one_line


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


class TestCache:
    def test_a_cache_that_is_not_there_yet(self, tmp_path):
        state = cache_state(tmp_path / "none")
        assert (state.writable, state.bytes, state.descriptions, state.integrity) == (True, 0, 0, "empty")
        assert list(tmp_path.iterdir()) == []

    def test_a_sound_cache_is_counted(self, tmp_path):
        with DescriptorCache(tmp_path / DATABASE) as cache:
            cache.remember("key", {"value": 1})
        state = cache_state(tmp_path)
        assert (state.descriptions, state.integrity) == (0, "ok")
        assert state.bytes == sum(size for size, _ in listing(tmp_path).values())
        assert (state.streams, state.stream_bytes) == (0, 0)

    def test_what_was_taken_from_videos_and_bags_is_counted(self, tmp_path):
        for name in ("one", "two"):
            (tmp_path / "streams" / name).mkdir(parents=True)
            (tmp_path / "streams" / name / "frame000000.png").write_bytes(b"image")
        state = cache_state(tmp_path)
        assert (state.streams, state.stream_bytes) == (2, 10)

    @pytest.mark.parametrize("spoil", [half, lambda path: flip(path, 30), lambda path: path.write_bytes(b"x" * 9999)])
    def test_damage_is_told_and_not_touched(self, spoil, tmp_path):
        with sqlite3.connect(tmp_path / DATABASE) as database:
            database.execute("CREATE TABLE descriptions (digest TEXT)")
            database.executemany("INSERT INTO descriptions VALUES (?)", [("x" * 500,)] * 100)
        database.close()
        spoil(tmp_path / DATABASE)
        before = listing(tmp_path)
        state = cache_state(tmp_path)
        assert state.integrity not in {"ok", "empty"}
        assert listing(tmp_path) == before

    def test_a_file_in_its_place_cannot_be_written(self, tmp_path):
        (tmp_path / "cache").write_text("in the way")
        assert not cache_state(tmp_path / "cache").writable


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
