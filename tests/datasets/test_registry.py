"""Sources: schemes, bare paths, and what is said of the others."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from omnieval.datasets import Camera, load, synthetic
from omnieval.datasets.cards import card
from omnieval.datasets.check import check
from omnieval.errors import DatasetError
from tests.datasets.trees import cold_names, make_cold, make_folder


def test_schemes_choose_the_reader(tmp_path):
    root = make_cold(tmp_path / "seq", cold_names(3))
    assert load(f"cold:{root}").positions is not None
    as_folder = load(f"folder:{root / 'omni_cam'}")
    assert (len(as_folder), as_folder.positions) == (3, None)


@pytest.mark.parametrize("as_type", [str, Path])
def test_a_bare_path_is_recognised_by_its_content(tmp_path, as_type):
    cold = make_cold(tmp_path / "a" / "inner", cold_names(2))
    images = make_folder(tmp_path / "b", ["1.png"])
    assert load(as_type(cold)).source == f"cold:{cold}"
    assert load(as_type(cold.parent)).source == f"cold:{cold}"
    assert load(as_type(cold / "omni_cam")).source == f"cold:{cold}"
    assert load(as_type(images)).source == f"folder:{images}"


@pytest.mark.parametrize(
    "source", ["cold:seq", "cold:./seq/", "seq", "folder:images", "images", "folder:seq/../images"]
)
def test_the_source_of_a_sequence_loads_it_again_from_elsewhere(tmp_path, monkeypatch, source):
    make_cold(tmp_path / "seq", cold_names(2))
    make_folder(tmp_path / "images", ["1.png"])
    monkeypatch.chdir(tmp_path)
    first = load(source)
    monkeypatch.chdir("/")
    again = load(first.source)
    assert (again.source, again.name, again.frames) == (first.source, first.name, first.frames)


def test_a_home_folder_is_expanded(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    make_cold(tmp_path / "seq", cold_names(2))
    assert load("cold:~/seq").root == tmp_path / "seq"


def test_a_path_with_a_colon_is_a_path(tmp_path, monkeypatch):
    make_folder(tmp_path / "run:1", ["1.png"])
    monkeypatch.chdir(tmp_path)
    assert load("run:1").root == tmp_path / "run:1"


@pytest.mark.parametrize(
    ("source", "complaint"),
    [
        ("cool:/data", "unknown source 'cool:/data'; did you mean cold?"),
        ("sythetic", "did you mean synthetic?"),
        ("cold:", "write cold:PATH"),
        ("folder:", "write folder:PATH"),
        ("", "the source is empty"),
        ("synthetic:nite", "did you mean night?"),
        ("/no/such/folder", "/no/such/folder: no such folder"),
        ("cold:/no/such/folder", "/no/such/folder: no such folder"),
        ("a\0b", "null character"),
    ],
)
def test_other_sources_are_refused_in_one_line(tmp_path, monkeypatch, source, complaint):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DatasetError) as caught:
        load(source)
    assert complaint in str(caught.value)
    assert str(caught.value).isprintable()


def test_a_file_and_a_folder_without_images_are_refused(tmp_path):
    (tmp_path / "notes.txt").touch()
    with pytest.raises(DatasetError, match="not a folder"):
        load(tmp_path / "notes.txt")
    with pytest.raises(DatasetError, match="neither a COLD sequence"):
        load(tmp_path)


class TestSynthetic:
    @pytest.fixture
    def lights(self, tmp_path, monkeypatch):
        """A tiny sequence in place of the rendered building; the lights it was asked for."""
        asked = []

        def cached(light, building):
            assert building == 1
            asked.append(light)
            root = tmp_path / light / "omnieval"
            return root if root.exists() else make_cold(root, cold_names(3), width=640)

        monkeypatch.setattr(synthetic, "cached", cached)
        return asked

    @pytest.mark.parametrize(
        ("source", "light"), [("synthetic", "cloudy"), ("synthetic:", "cloudy"), ("synthetic:night", "night")]
    )
    def test_it_is_rendered_and_read_like_any_cold_sequence(self, lights, source, light):
        sequence = load(source)
        assert lights == [light]
        assert (sequence.name, sequence.source, sequence.card) == (
            f"synthetic-{light}",
            f"synthetic:{light}",
            "synthetic",
        )
        assert sequence.rooms == ("CR",) * 3
        assert sequence.camera == Camera("omnidirectional", card("synthetic").mirror)

    def test_it_is_the_default(self, lights):
        assert load().source == "synthetic:cloudy"

    def test_a_check_compares_it_with_its_card(self, lights):
        report = check("synthetic:night")
        assert {finding.code for finding in report.findings} == {"count-differs", "length-differs", "size-differs"}
        assert report.ok


def test_importing_the_datasets_is_light():
    heavy = "{'cv2', 'pydantic', 'scipy', 'polars'}"
    code = f"import sys, omnieval.datasets; print(sorted({heavy} & set(sys.modules)))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"


def test_a_pattern_behind_a_scheme_is_not_expanded_by_a_shell(tmp_path):
    with pytest.raises(DatasetError, match=r"a shell expands \* only in a path without a scheme"):
        load(f"cold:{tmp_path}/*/seq*")
