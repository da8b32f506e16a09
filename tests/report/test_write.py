"""The folder of a report: whole, the same every time, and nothing of anybody else's touched."""

import json
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

import cv2
import numpy as np
import polars as pl
import pytest

import omnieval
from omnieval.errors import ConfigError, ResultError
from omnieval.report.build import Order, build
from omnieval.report.draw import svg_of
from omnieval.report.figure import Figure
from omnieval.report.sources import open_sources
from omnieval.report.write import write_report
from tests.report.conftest import SMALL, replay_of

LOADING = {"script", "link", "iframe", "object", "embed", "img", "source", "video", "audio", "image", "use", "base"}


class Page(HTMLParser):
    """Tags, attributes and text of a page; fails when tags do not nest."""

    VOID = frozenset({"meta", "link", "br", "hr", "img"})

    def __init__(self):
        super().__init__()
        self.seen, self.stack, self.headings, self.text = [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.stack.append(tag)
        if re.fullmatch(r"h[1-6]", tag):
            self.headings.append(int(tag[1]))

    def handle_startendtag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def pixels(file):
    picture = cv2.imread(str(file))
    assert picture is not None
    return picture


def parsed(folder):
    page = Page()
    page.feed((folder / "index.html").read_text("utf-8"))
    assert page.stack == []
    return page


@pytest.fixture(scope="session")
def report(run, sweep, baseline, tmp_path_factory):
    return write_report([sweep, run, baseline], out=tmp_path_factory.mktemp("written") / "report")


def test_every_figure_is_there_as_svg_png_and_csv(report):
    figures = [block for section in report.content.sections for block in section.blocks if isinstance(block, Figure)]
    files = sorted(path.name for path in (report.folder / "figures").iterdir())
    assert len(figures) == 1 + 6 + 6 + 1
    assert len(files) == 3 * len(figures)
    for number, figure in enumerate(figures, start=1):
        stem = report.folder / "figures" / f"{number:02d}-{figure.key}"
        root = ET.parse(stem.with_suffix(".svg")).getroot()
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        picture = pixels(stem.with_suffix(".png"))
        assert picture.shape[1] == pytest.approx(2 * float(root.attrib["width"]), abs=2)
        assert picture.std() > 5
        assert len(pl.read_csv(stem.with_suffix(".csv"), infer_schema=False)) == len(figure.data)
    assert {f"figures/{name}" for name in files} | {"index.html"} == set(report.files)


def test_the_page_loads_nothing_from_anywhere(report):
    for tag, attributes in parsed(report.folder).seen:
        inside = attributes.get("src", "").startswith("data:image/jpeg;base64,") and "srcset" not in attributes
        assert tag not in LOADING or attributes == {"rel": "icon", "href": "data:,"} or (tag == "img" and inside)
        assert not any(name.startswith("on") for name in attributes)
    style = (report.folder / "index.html").read_text("utf-8").split("<style>")[1].split("</style>")[0]
    assert "url(" not in style
    assert "@import" not in style


def test_links_lead_somewhere(report):
    page = parsed(report.folder)
    ids = [attributes["id"] for _, attributes in page.seen if "id" in attributes]
    assert len(ids) == len(set(ids))
    links = [attributes["href"] for tag, attributes in page.seen if tag == "a"]
    for link in links:
        if link.startswith("#"):
            assert link[1:] in ids
        elif not link.startswith("https://doi.org/"):
            assert (report.folder / link).exists()
    labels = {name for _, attributes in page.seen for name in attributes.get("aria-labelledby", "").split()}
    assert labels <= set(ids)
    inside = (report.folder / "index.html").read_text("utf-8")
    assert set(re.findall(r"url\(#([\w-]+)\)", inside)) <= set(ids)


def test_headings_are_in_order_and_every_figure_has_words(report):
    page = parsed(report.folder)
    assert page.headings[0] == 1
    assert page.headings.count(1) == 1
    assert all(after - before <= 1 for before, after in zip(page.headings, page.headings[1:], strict=False))
    assert ("html", {"lang": "en"}) in page.seen
    count = len(list((report.folder / "figures").glob("*.svg")))
    tags = [tag for tag, _ in page.seen]
    assert tags.count("figure") == tags.count("figcaption") == tags.count("details") == tags.count("svg") == count
    images = [attributes for tag, attributes in page.seen if tag == "svg"]
    assert all(attributes["role"] == "img" and attributes["aria-labelledby"] for attributes in images)
    for section in report.content.sections:
        for block in section.blocks:
            if isinstance(block, Figure):
                assert len(block.alt) > 60
                assert "the paper" in block.caption.casefold()


def test_a_report_made_again_is_the_same_to_the_byte(report, run, sweep, baseline, tmp_path):
    again = write_report([sweep, run, baseline], out=tmp_path / "again")
    assert again.files == report.files
    for name in report.files:
        assert (again.folder / name).read_bytes() == (report.folder / name).read_bytes(), name


def test_ids_do_not_depend_on_what_was_drawn_before(report):
    figure = next(block for section in report.content.sections for block in section.blocks if isinstance(block, Figure))
    first, second = svg_of(figure.chart, "f"), svg_of(figure.chart, "f")
    assert first == second
    assert set(re.findall(r'id="([^"]+)"', first)) >= set(re.findall(r"url\(#([^)]+)\)", first))


def test_hostile_names_stay_text(panoramas, tmp_path):
    name = "<img src=x onerror=alert(1)> & \"q\" 'a' {{7}}"
    images = tmp_path / "images"
    images.mkdir()
    for file in sorted(panoramas.iterdir()):
        content = file.read_bytes()
        if file.name == "poses.csv":
            content = content.replace(b"R0", b"<b>R0</b>")
        (images / file.name).write_bytes(content)
    folder = replay_of(images, tmp_path / name).folder
    report = write_report([folder], out=tmp_path / "out")
    page = parsed(report.folder)
    assert not {"b", "script"} & {tag for tag, _ in page.seen}
    assert all(attributes["src"].startswith("data:image/jpeg;") for tag, attributes in page.seen if tag == "img")
    assert name in "".join(page.text)
    for file in (report.folder / "figures").glob("*.svg"):
        assert ET.parse(file) is not None


def test_a_report_lies_in_its_first_path_and_leaves_the_run_alone(run, tmp_path):
    before = {path: path.read_bytes() for path in run.iterdir() if path.is_file()}
    report = write_report([run])
    assert report.page == run / "report" / "index.html"
    assert {path: path.read_bytes() for path in run.iterdir() if path.is_file()} == before
    with pytest.raises(ResultError, match="pass --overwrite"):
        write_report([run])


def test_overwriting_removes_only_what_a_report_wrote(sweep, baseline, tmp_path):
    out = tmp_path / "report"
    large = write_report([sweep, baseline], out=out)
    (out / "figures" / "mine.png").write_bytes(b"mine")
    (out / "notes.txt").write_text("mine")
    small = write_report([baseline], out=out, overwrite=True)
    assert len(small.files) < len(large.files)
    left = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert set(small.files) | {"run.json", "figures/mine.png", "notes.txt"} == {
        name for name in left if not name.startswith(".")
    }


def test_a_forged_manifest_cannot_have_other_files_removed(baseline, tmp_path):
    out = tmp_path / "report"
    write_report([baseline], out=out)
    precious = tmp_path / "precious.txt"
    precious.write_text("mine")
    manifest = json.loads((out / "run.json").read_text())
    manifest["files"] += ["../precious.txt", str(precious), "figures/../../precious.txt"]
    (out / "run.json").write_text(json.dumps(manifest))
    write_report([baseline], out=out, overwrite=True)
    assert precious.read_text() == "mine"


def test_folders_of_others_are_refused(run, tmp_path):
    (tmp_path / "photo.txt").write_text("mine")
    with pytest.raises(ResultError, match="choose another"):
        write_report([run], out=tmp_path)
    with pytest.raises(ResultError):
        write_report([run], out=run, overwrite=True)
    assert (run / "steps.parquet").exists()


def test_a_step_that_no_replay_has_is_refused_before_anything_is_written(run, baseline, tmp_path):
    with pytest.raises(ConfigError, match="--step 80: the longest replay ends at step 79"):
        write_report([run], Order(step=80), out=tmp_path / "a")
    with pytest.raises(ConfigError, match="no replay with its steps"):
        write_report([baseline], Order(step=3), out=tmp_path / "b")
    assert list(tmp_path.iterdir()) == []


def test_the_chosen_step_is_drawn(run, baseline, tmp_path):
    steps = pl.read_parquet(run / "steps.parquet")
    refused = steps.filter(pl.col("best_frame").is_not_null())["frame"][0]
    report = write_report([run, baseline], Order(step=refused), out=tmp_path / "out")
    assert f"Similarity curves of step {refused}" in report.page.read_text("utf-8")
    assert "most candidate images" not in report.page.read_text("utf-8")


def test_a_step_without_curve_is_left_out_with_a_sentence(run, baseline, tmp_path):
    report = write_report([run, baseline], Order(step=0), out=tmp_path / "out")
    (skipped,) = report.skipped
    assert "no node let it in" in skipped.reason
    assert "no node let it in" in report.page.read_text("utf-8")


def test_progress_is_told_replay_by_replay(run, sweep, baseline):
    told = []
    order = Order(progress=lambda done, total: told.append((done, total)))
    build(open_sources([run, sweep, baseline]), order)
    assert told == [(1, 2), (2, 2)]


def test_pictures_are_on_white_paper(report):
    for file in sorted((report.folder / "figures").glob("*.png")):
        picture = pixels(file)
        assert (picture[0, 0, :3] == 255).all()
        assert np.ptp(picture[..., :3]) > 200


def test_a_sweep_without_poses_is_drawn_as_far_as_it_goes(unposed, tmp_path):
    images = tmp_path / "unposed"
    fixed = {name: value for name, value in SMALL.items() if name != "omega"}
    omnieval.ablate(images, {"omega": [2.5, 3.5]}, settings=fixed, out=tmp_path / "sweep", keep_steps=True)
    report = write_report([tmp_path / "sweep"], out=tmp_path / "out")
    (skipped,) = report.skipped
    assert "no run has a silhouette" in skipped.reason
    assert sorted(report.files) == [
        "figures/01-sweep-hog.csv",
        "figures/01-sweep-hog.png",
        "figures/01-sweep-hog.svg",
        "index.html",
    ]


def test_what_can_never_be_made_again_leaves_out_its_figures_with_a_sentence(panoramas, tmp_path):
    class Local:
        """A descriptor that no later process can make."""

        def describe(self, panorama):
            return omnieval.Description(panorama[:4].mean(axis=1), panorama[:4].T.copy())

    run = omnieval.replay(panoramas, config=SMALL, descriptor=Local(), out=tmp_path / "run")
    report = write_report([run.folder], out=tmp_path / "out")
    text = report.page.read_text("utf-8")
    assert [one.title.partition(" of step")[0] for one in report.skipped] == [
        "Batch clustering over the number of clusters",
        "Similarity curves",
    ]
    for one in report.skipped:
        assert "the descriptor local was an object in memory, not in a file or package" in one.reason
        assert "the descriptor local was an object" in text
    assert any(name.endswith("map.svg") for name in report.files)


def test_a_leaders_report_has_no_figure_of_the_papers_method(panoramas, tmp_path):
    run = omnieval.replay(panoramas, mapper="leader", radius=1.5, out=tmp_path / "run")
    report = write_report([run.folder], out=tmp_path / "out")
    assert [one.reason for one in report.skipped] == ["the mapper leader has none"]
    assert [name for name in report.files if "gate" in name or "similarity" in name] == []
    assert "radius = 1.5" in report.page.read_text("utf-8")
