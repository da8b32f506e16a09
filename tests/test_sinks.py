"""A recording that hangs costs nothing but the recording."""

import threading

import pytest

import omnieval
from omnieval import sinks
from omnieval.loop import replay
from omnieval.recording import RecordingOptions

CONFIG = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}
CONNECTED = RecordingOptions(connect="rerun+http://127.0.0.1:1/proxy")


class Frozen:
    """A recorder whose viewer takes nothing more from some call on."""

    failure = None

    def __init__(self, *, at, thawing):
        self._at, self._thawing, self.closed = at, thawing, False

    def wants_images(self, frame):
        return False

    def _call(self, name):
        if name == self._at:
            self._thawing.wait()

    def log(self, step, image, milliseconds, *, silhouette, pictures):
        self._call(f"step {step.frame}")

    def finish(self, final, page):
        self._call("finish")

    def close(self):
        self._call("close")
        self.closed = True


@pytest.fixture(scope="module")
def alone(panoramas, tmp_path_factory):
    """The run that nobody watches."""
    return replay(panoramas, config=omnieval.configure(CONFIG), out=tmp_path_factory.mktemp("alone") / "run")


@pytest.fixture
def frozen(monkeypatch):
    """Makes recorders that freeze; afterwards they thaw."""
    left, thawing = [], threading.Event()
    monkeypatch.setattr(sinks, "leave_behind", lambda: left.append(True))
    made = []

    def make(at):
        made.append(Frozen(at=at, thawing=thawing))
        monkeypatch.setattr(sinks, "Recorder", lambda *arguments: made[-1])
        return made[-1], left

    yield make
    thawing.set()


@pytest.mark.parametrize("at", ["step 0", "step 40", "step 79", "finish", "close"])
def test_a_frozen_viewer_does_not_keep_a_replay_from_ending(at, frozen, alone, panoramas, tmp_path, monkeypatch):
    monkeypatch.setattr(sinks, "_PATIENCE_S", 0.05)
    recorder, left = frozen(at)
    run = replay(panoramas, config=omnieval.configure(CONFIG), out=tmp_path / "run", recording=CONNECTED)
    assert (run.status, run.content_hash) == ("complete", alone.content_hash)
    assert "the viewer has not responded for 0.05 s" in run.manifest["recording_failure"]
    assert not recorder.closed
    assert left == [True]


def test_a_slow_disk_is_waited_for(frozen, panoramas, tmp_path, monkeypatch):
    monkeypatch.setattr(sinks, "_PATIENCE_S", 0.0)
    recorder, left = frozen("never")
    run = replay(panoramas, config=omnieval.configure(CONFIG), out=tmp_path / "run", recording=RecordingOptions())
    assert run.manifest["recording_failure"] is None
    assert (recorder.closed, left) == (True, [])
