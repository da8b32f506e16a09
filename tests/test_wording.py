"""Names in words and in file names."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.wording import did_you_mean, near_path, safe_name, shown


@given(st.text())
def test_what_is_shown_is_printable(text):
    assert shown(text).isprintable()


@given(st.text())
def test_a_safe_name_is_a_plain_file_name(text):
    name = safe_name(text)
    assert 0 < len(name) <= 100
    assert "/" not in name
    assert not name.startswith((".", "-"))
    assert safe_name(name) == name


@pytest.mark.parametrize(
    ("text", "name"), [("seq2_cloudy3", "seq2_cloudy3"), ("a b/c:d", "a-b-c-d"), ("..", "sequence"), ("Büro", "Büro")]
)
def test_a_safe_name_stays_readable(text, name):
    assert safe_name(text) == name


def test_of_a_long_name_the_middle_is_left_out():
    name = safe_name(f"{'seq' * 50}-hog")
    assert len(name) == 100
    assert name.startswith("seqseq")
    assert name.endswith("seq-hog")
    assert safe_name("a" * 100) == "a" * 100


def test_a_hint_names_the_nearest_or_all():
    assert did_you_mean("Nihgt", ["cloudy", "night"]) == "did you mean night?"
    assert did_you_mean("zzz", ["cloudy", "night"]) == "known are cloudy, night"


def test_a_path_that_is_not_there_is_helped_by_what_is_called_alike(tmp_path):
    (tmp_path / "replay.rrd").touch()
    (tmp_path / ".replay.rd").touch()
    assert near_path(tmp_path / "replay.rd") == "did you mean replay.rrd?"
    assert near_path(tmp_path / "zzz") == near_path(tmp_path / "none" / "replay.rd") == "check the path"
