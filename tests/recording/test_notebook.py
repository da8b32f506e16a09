"""A notebook shows a run in the layout of the viewer, whether or not the viewer for notebooks is installed here."""

import gc
import sys
import types
import weakref
from typing import Any, cast

import pytest
import rerun.notebook
from rerun.chunk import RrdReader

import omnieval
from omnieval.errors import OmnievalError, ResultError
from omnieval.recording import RecordingOptions, notebook
from tests.recording.test_blueprint import views


class FakeViewer:
    """Takes what the widget would be given."""

    def __init__(self, *, width, height, recording, blueprint, theme):
        self.size = width, height
        self.blueprint = blueprint
        self.theme = theme
        self.recording_id = recording.get_recording_id()
        self.recording = weakref.ref(recording)


def shown(run, **options) -> Any:
    """Show a run; what comes back is a `FakeViewer`."""
    return notebook.show(run, **options)


@pytest.fixture(autouse=True)
def fake_viewer(monkeypatch):
    monkeypatch.setattr(rerun.notebook, "HAS_NOTEBOOK", True)
    monkeypatch.setattr(rerun.notebook, "Viewer", FakeViewer)


@pytest.fixture(scope="module")
def run(panoramas, tmp_path_factory):
    sequence = omnieval.load(f"folder:{panoramas}").cut(limit=30)
    options = RecordingOptions(images=False)
    return omnieval.replay(sequence, out=tmp_path_factory.mktemp("runs") / "run", recording=options)


def test_the_viewer_has_the_layout_and_the_width_of_the_cell(run):
    viewer = shown(run)
    assert viewer.size == ("auto", "auto")
    assert "Map (pending nodes in brackets)" in {view.name for view in views(viewer.blueprint.root_container)}
    assert viewer.blueprint.time_panel.play_state == "paused"
    assert viewer.theme == "dark"  # the colours are made for it


def test_a_size_is_kept(run):
    assert shown(run, size=(1280, 800)).size == (1280, 800)


def test_the_file_goes_into_one_recording_that_lives_as_long_as_its_viewer(run):
    viewer = shown(run)
    (in_file,) = RrdReader(run.recording).recordings()
    assert viewer.recording_id == in_file.recording_id
    gc.collect()
    recording = viewer.recording
    assert recording() is not None
    del viewer
    gc.collect()
    assert recording() is None


def test_a_run_without_recording_says_how_to_make_one(panoramas, tmp_path):
    bare = omnieval.replay(omnieval.load(f"folder:{panoramas}").cut(limit=25), out=tmp_path / "bare")
    with pytest.raises(ResultError, match="omnieval render"):
        shown(bare)


def test_without_the_viewer_for_notebooks_it_says_what_to_install(run, monkeypatch):
    monkeypatch.setattr(rerun.notebook, "HAS_NOTEBOOK", False)
    with pytest.raises(OmnievalError, match=r"pip install 'rerun-sdk\[notebook\]'"):
        shown(run)


class FakeDisplay:
    """Takes what would be shown below the cell."""

    def __init__(self, *, is_notebook=True):
        self.shown = []
        self.is_notebook = is_notebook
        self.HTML = str

    def display(self, value, *, display_id):
        assert display_id
        self.shown.append(value)
        return self if self.is_notebook else None

    def update(self, value):
        self.shown.append(value)


def test_a_bar_is_drawn_at_the_first_and_the_last_and_not_all_the_time(monkeypatch):
    here = FakeDisplay()
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", cast("types.ModuleType", here))
    monkeypatch.setattr("omnieval.recording.notebook.time.monotonic", lambda: 5.0)
    done = notebook.progress("<images>")
    for number in range(1, 1001):
        done(number, 1000)
    assert here.shown == [
        "",
        '<progress value="1" max="1000"></progress> &lt;images&gt; 1 of 1,000',
        '<progress value="1000" max="1000"></progress> &lt;images&gt; 1,000 of 1,000',
    ]


@pytest.mark.parametrize("display", [None, FakeDisplay(is_notebook=False)], ids=["no IPython", "no notebook"])
def test_elsewhere_there_is_no_bar(display, monkeypatch):
    monkeypatch.setitem(sys.modules, "IPython", None if display is None else types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    with pytest.raises(OmnievalError, match="there is no notebook here"):
        notebook.progress()


def test_a_map_shows_its_largest_nodes_with_their_rooms(run):
    shown = run.map._repr_html_()
    assert shown.count("<tr>") == 1 + len(run.map.nodes)
    assert f"{len(run.map.nodes)} nodes over 30 images" in shown
    assert "R0 16" in shown
    assert len(shown) < 3000
