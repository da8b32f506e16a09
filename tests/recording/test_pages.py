"""An image of the map that is selected says what it is, and what became of it."""

import pytest

from omnieval.recording import layout
from tests.recording.readback import column
from tests.recording.test_recorder import COUNT, record


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("facts") / "replay.rrd"
    record(path, pictures=False)
    return path


def test_an_image_that_is_selected_says_what_it_is_and_what_became_of_it(recorded):
    frames = [str(frame) for frame in range(COUNT)]
    assert column(recorded, layout.MAP_IMAGES, "image") == {None: frames}
    assert column(recorded, layout.MAP_IMAGES, "file")[None][20] == "image-20.jpeg"
    assert column(recorded, layout.MAP_IMAGES, "room")[None][20:31:10] == ["KT", "LR"]
    assert column(recorded, layout.MAP_IMAGES, "decision")[None][20] == "refused: prominence 3.1 x mean < 5"
    assert column(recorded, layout.MAP_IMAGES, "outcome")[None][19:21] == ["closed", "refused"]
    assert column(recorded, layout.MAP_IMAGES, "best_match_metres")[None][20] == "3.41"
    assert column(recorded, layout.MAP_IMAGES, "final_node")[None][-2:] == ["1", "2"]


def test_the_images_drawn_since_all_were_say_the_same(recorded):
    facts = column(recorded, layout.MAP_RECENT, "image")
    drawn = column(recorded, layout.MAP_IMAGES, "Points2D:positions")
    shown = column(recorded, layout.MAP_RECENT, "Points2D:positions")
    known: list[str] = []
    for frame in range(COUNT):
        known = facts.get(frame) or known
        redrawn = max((at for at in drawn if at is not None and at <= frame and drawn[at]), default=-1)
        recent = shown[frame]
        assert known[: len(recent)] == [str(number) for number in range(redrawn + 1, frame + 1)][: len(recent)], frame
        assert len(recent) == frame - redrawn


def test_an_interrupted_replay_says_of_its_images_all_but_where_they_ended(tmp_path):
    path = tmp_path / "replay.rrd"
    record(path, count=30, finished=False)
    assert len(column(path, layout.MAP_IMAGES, "image")[None]) == 30
    assert column(path, layout.MAP_IMAGES, "final_node") == {}


def test_facts_of_images_take_less_than_a_kilobyte_a_step(recorded):
    facts = ("image", "file", "room", "outcome", "decision", "best_match_metres", "final_node")
    size = sum(
        len(text)
        for entity in (layout.MAP_IMAGES, layout.MAP_RECENT)
        for name in facts
        for texts in column(recorded, entity, name).values()
        for text in texts or ()
    )
    assert 0 < size / COUNT < 1000
