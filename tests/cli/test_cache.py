"""`omnieval cache`: what a person and a script read of it."""

import json

import pytest

from tests.cli.test_cli import in_process
from tests.trust.inputs import one_line


@pytest.fixture
def cache(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    folder.mkdir()
    (folder / "descriptors-3.sqlite").write_bytes(bytes(2_500_000))
    (folder / "side-by-side-0123.rrd").write_bytes(bytes(500))
    monkeypatch.setenv("OMNIEVAL_CACHE", str(folder))
    return folder


def test_what_there_is(cache, tmp_path):
    result = in_process("cache", "info", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    assert lines[0] == str(cache)
    assert "of older versions: 1, 2.5 MB" in lines
    assert "pairs: 1, 500 bytes" in lines
    content = json.loads(in_process("cache", "info", "--json", cwd=tmp_path).stdout)
    assert content["bytes"] == 2_500_500
    assert content["integrity"] == "empty"
    assert content["kinds"]["of older versions"] == {"count": 1, "bytes": 2_500_000}
    assert content["kinds"]["streams"] == {"count": 0, "bytes": 0}


def test_what_is_removed(cache, tmp_path):
    told = in_process("cache", "prune", "--max", "1kB", "--dry-run", cwd=tmp_path)
    assert told.stdout.splitlines()[0] == "would be removed"
    assert len(list(cache.iterdir())) == 2
    result = in_process("cache", "prune", "--max", "1kB", "--older", "30d", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines() == [
        "removed",
        "  of older versions  1, 2.5 MB",
        "in use, kept: nothing",
        "left: 500 bytes",
    ]
    content = json.loads(in_process("cache", "prune", "--max", "0", "--json", cwd=tmp_path).stdout)
    assert content == {
        "schema_version": 1,
        "dry_run": False,
        "removed": {"pairs": {"count": 1, "bytes": 500}},
        "in_use": {},
        "bytes_left": 0,
    }
    assert list(cache.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--older", "30"), "--older: a time such as 30d, 12h or 4w, not '30'"),
        (("--max", "10G"), "--max: a size such as 10GB or 500MB, not '10G'"),
        (("--max", "-1GB"), "--max: a size such as"),
    ],
)
def test_what_is_no_rule_is_refused(cache, tmp_path, arguments, expected):
    result = in_process("cache", "prune", *arguments, cwd=tmp_path)
    assert result.returncode == 2
    one_line(result.stderr, expected)
    assert len(list(cache.iterdir())) == 2
