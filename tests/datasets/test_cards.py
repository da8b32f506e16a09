"""Data cards: all valid, found by folder, refused when wrong."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import pytest

from omnieval.datasets import Mirror, cards
from omnieval.datasets.cards import all_cards, card, find_card, parse_card
from omnieval.errors import DatasetError

MINIMAL = "title = 'T'\nget = 'G'\ncitation = 'C'\n"


def test_the_five_families_are_known():
    names = [known.name for known in all_cards()]
    assert names == ["cold-freiburg", "cold-ljubljana", "cold-saarbruecken", "innova", "synthetic"]


def test_cards_hold_the_published_routes():
    expected = {"innova": (1450, 176.26), "cold-saarbruecken": (1021, 56.64), "cold-freiburg": (2778, 102.68)}
    assert {name: (card(name).sequences[0].images, card(name).sequences[0].length_m) for name in expected} == expected


def test_the_mirror_of_cold_is_not_known():
    assert all(card(name).mirror is None for name in ("cold-freiburg", "cold-saarbruecken", "cold-ljubljana"))


@pytest.mark.parametrize(
    ("folder", "name", "sequence"),
    [
        ("/data/cold-freiburg/part_a/seq2_cloudy3", "cold-freiburg", "part_a/seq2_cloudy3"),
        ("/data/COLD-Freiburg/part_a/seq2_cloudy3", "cold-freiburg", "part_a/seq2_cloudy3"),
        ("/data/cold-freiburg_part_a_seq2_cloudy3", "cold-freiburg", "part_a/seq2_cloudy3"),
        (
            "/d/cold-freiburg/part_a/seq2_cloudy3/cold-freiburg_part_a_seq2_cloudy3",
            "cold-freiburg",
            "part_a/seq2_cloudy3",
        ),
        ("/d/cold-freiburg/part_a/seq2_cloudy3/inner", "cold-freiburg", "part_a/seq2_cloudy3"),
        ("/d/cold-freiburg/part_b/seq2_cloudy3", "cold-freiburg", None),
        ("/d/cold-saarbrücken/part_b/seq4_cloudy1", "cold-saarbruecken", "part_b/seq4_cloudy1"),
        ("/d/cold-ljubljana/part_a/seq1_sunny1", "cold-ljubljana", None),
        ("/d/part_a/seq2_cloudy3", None, None),
        ("/d/my-cold-freiburg-copy/seq2_cloudy3", None, None),
        ("/", None, None),
    ],
)
def test_a_folder_is_recognised_by_its_parts(folder, name, sequence):
    known, path = find_card(Path(folder))
    assert (known.name if known else None, path) == (name, sequence)


def test_an_unknown_card_names_the_nearest():
    with pytest.raises(DatasetError, match=r"did you mean cold-freiburg\?"):
        card("cold-friburg")


def test_a_card_may_say_no_more_than_is_known():
    known = parse_card("x", MINIMAL)
    assert (known.name, known.mirror, known.image_size, known.sequences) == ("x", None, None, ())


def test_a_card_may_give_the_mirror():
    text = MINIMAL + "[mirror]\ncx = 1\ncy = 2\nr_in = 3\nr_out = 4\n"
    assert parse_card("x", text).mirror == Mirror(1, 2, 3, 4)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("title = ", "not valid TOML"),
        ("title = 'T'", "no get"),
        (MINIMAL + "licens = 'x'", "unknown key 'licens'; did you mean licence?"),
        (MINIMAL + "[[sequences]]\npath = 'a'\nimages = 0", "sequences.0.images"),
        (MINIMAL + "[mirror]\ncx = 1\ncy = 2\nr_in = 4\nr_out = 3", "0 <= r_in < r_out"),
    ],
)
def test_a_wrong_card_is_refused_by_its_field(text, complaint):
    with pytest.raises(DatasetError) as caught:
        parse_card("x", text)
    assert complaint in str(caught.value)
    assert "data card x" in str(caught.value)


def test_an_installed_package_has_its_cards_inside(tmp_path, monkeypatch):
    inside = tmp_path / "cards_data"
    inside.mkdir()
    (inside / "mine.toml").write_text(MINIMAL)
    monkeypatch.setattr(cards, "files", lambda package: files(package) if package != "omnieval.datasets" else tmp_path)
    all_cards.cache_clear()
    try:
        assert [known.name for known in all_cards()] == ["mine"]
        (inside / "mine.toml").unlink()
        all_cards.cache_clear()
        with pytest.raises(DatasetError, match="reinstall"):
            all_cards()
    finally:
        all_cards.cache_clear()
