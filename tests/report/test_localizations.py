"""Localisations in a report, compared with the numbers of their folders."""

import base64
import re

import cv2
import numpy as np
import polars as pl
import pytest

import omnieval
from omnieval.errors import ResultError
from omnieval.localization.published import PUBLISHED
from omnieval.report import gallery as nodes
from omnieval.report.build import Order, build
from omnieval.report.figure import Figure, Gallery, Skipped, Table
from omnieval.report.localizations import lights_table
from omnieval.report.sources import open_sources, replay_of
from omnieval.report.write import write_report
from tests.report.conftest import replay_of as replayed


@pytest.fixture(scope="module")
def found(run, panoramas, tmp_path_factory):
    """The sequence, thinned, looked for in its own map."""
    out = tmp_path_factory.mktemp("found") / "light"
    return omnieval.localize(run, str(panoramas), stride=5, out=out)


def blocks(folder):
    return [block for section in build(open_sources([folder]), Order()).sections for block in section.blocks]


def test_the_figures_hold_what_the_table_says(found):
    made = blocks(found.folder)
    route, cumulative = [block for block in made if isinstance(block, Figure)]
    posed = found.table.filter(pl.col("reachable").is_not_null())
    assert route.data["error"].to_list() == posed["error"].to_list()
    shares = cumulative.data.filter(strategy="levels")
    errors = posed.filter(strategy="levels")["error"]
    for within, share in shares.select("within", "share").gather_every(20).iter_rows():
        assert share == pytest.approx(sum(1 for one in errors if one is not None and one <= within) / len(errors))
    (measures,) = [block for block in made if isinstance(block, Table) and block.key == "measures"]
    said = {row[0]: float(str(row[measures.columns.index("mean error, m")])) for row in measures.rows}
    assert said == pytest.approx(dict(found.measures.select("strategy", "error_mean").rows()), abs=5e-4)


def test_every_light_stands_against_every_light_and_theirs_is_called_theirs(found):
    table = lights_table([found])
    (sequence,) = found.manifest["metrics"]
    place = table.columns.index(f"{sequence}, m")
    said = {row[2]: float(str(row[place])) for row in table.rows}
    assert said == pytest.approx(dict(found.measures.select("strategy", "error_mean").rows()), abs=5e-4)
    theirs = next(block for block in blocks(found.folder) if getattr(block, "key", "") == "published-localization")
    assert theirs.groups[0][0].startswith("Published by others")
    assert len(theirs.rows) == len(PUBLISHED)


def test_without_true_positions_the_figures_are_left_out_with_a_sentence(unposed, panoramas, tmp_path):
    found = omnieval.localize(unposed, str(panoramas), strategies=["nearest"], limit=5, out=tmp_path / "light")
    made = blocks(found.folder)
    assert [block.reason for block in made if isinstance(block, Skipped)] == 2 * [
        "the queries or the map have no true positions, so there are no errors"
    ]


def test_the_page_of_runs_and_localisations_is_written(found, run, tmp_path):
    made = write_report([found.folder, run], out=tmp_path / "report")
    text = made.page.read_text("utf-8")
    assert "Localisation light" in text
    assert "Published: mean errors on COLD-Freiburg" in text
    assert write_report([found.folder], out=tmp_path / "alone").page.exists()


def test_every_node_has_its_picture_in_the_page(run, panoramas, tmp_path):
    text = write_report([run], out=tmp_path / "report").page.read_text("utf-8")
    opened = omnieval.open_run(run)
    present = opened.nodes.filter(pl.col("merged").is_null())
    files = [opened.steps["file"][frame] for frame in present["representative_frame"]]
    shown = re.findall(r'<img loading="lazy"[^>]*src="data:image/jpeg;base64,([^"]+)"', text)
    assert len(shown) == len(files)
    for content, file in zip(shown, files, strict=True):
        picture = cv2.imdecode(np.frombuffer(base64.b64decode(content), np.uint8), cv2.IMREAD_COLOR)
        source = cv2.imread(str(panoramas / file))
        assert picture is not None
        assert source is not None
        assert picture.shape[1] <= 320
        assert np.abs(picture.astype(int) - cv2.resize(source, picture.shape[1::-1])).mean() < 8


def test_of_many_nodes_the_first_are_shown_and_the_rest_are_said(run, monkeypatch):
    monkeypatch.setattr(nodes, "MOST", 1)
    made = nodes.gallery(replay_of(omnieval.open_run(run)))
    assert isinstance(made, Gallery)
    assert len(made.photos) == 1
    assert re.search(r"The first 1 of \d+ nodes; omnieval export RUN --images DIR", made.caption)


def test_pictures_of_images_that_are_gone_are_left_out_with_a_sentence(panoramas, tmp_path):
    images = tmp_path / "images"
    images.mkdir()
    for number in range(60):
        (images / f"image{number}.png").write_bytes((panoramas / f"image{number}.png").read_bytes())
    made = replayed(images, tmp_path / "run")
    (images / "image3.png").unlink()
    reasons = {block.title: block.reason for block in blocks(made.folder) if isinstance(block, Skipped)}
    assert "image3.png" in reasons["The nodes"]


def test_a_localisation_that_did_not_end_is_refused(found, tmp_path):
    half = tmp_path / "half"
    half.mkdir()
    content = (found.folder / "run.json").read_text().replace('"status": "complete"', '"status": "interrupted"')
    (half / "run.json").write_text(content)
    (half / "localization.parquet").write_bytes((found.folder / "localization.parquet").read_bytes())
    with pytest.raises(ResultError, match="is not complete; localise again"):
        open_sources([half])
