"""Two runs in one recording: every shared step once, what differs marked, partners in the same colour."""

import numpy as np
import pytest

import omnieval
from omnieval.errors import ResultError
from omnieval.loop import replay
from omnieval.recording import entities
from omnieval.recording.side_by_side import APPLICATION_ID, record_pair
from omnieval.results.compare import agreement
from tests.recording.readback import column, rows_per_entity

CONFIG = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}


@pytest.fixture(scope="module")
def runs(panoramas, tmp_path_factory):
    out = tmp_path_factory.mktemp("pair")

    def run(gamma):
        return replay(panoramas, config=omnieval.configure({**CONFIG, "gamma": gamma}), out=out / f"gamma{gamma:g}")

    return run(1.0), run(20.0)


@pytest.fixture(scope="module")
def agreed(runs):
    return agreement(*runs)


@pytest.fixture(scope="module")
def recorded(runs, agreed, tmp_path_factory):
    return record_pair(tmp_path_factory.mktemp("both") / "both.rrd", runs[0], runs[1], agreed)


def test_every_shared_step_is_there_for_both(recorded):
    rows = rows_per_entity(recorded)
    for entity in (entities.LOG_DECISION, *(root + entities.WHY for root in ("/a", "/b"))):
        assert rows[entity] == 80, entity
    assert rows["/a/map/robot"] == rows["/b/map/robot"] == 80


def test_each_side_says_its_own_decision(recorded, agreed):
    frame = agreed.first_parted
    pages = [column(recorded, root + entities.WHY, "TextDocument:text")[frame][0] for root in ("/a", "/b")]
    assert pages[0].startswith("**joined node")
    assert pages[1].startswith("**refused (prominence)")
    (words,) = column(recorded, entities.LOG_DECISION, "TextLog:text")[frame]
    assert words == f"{frame}: assigned, node 1 | prominence"


def test_steps_that_differ_are_marked(recorded, agreed):
    levels = column(recorded, entities.LOG_DECISION, "TextLog:level")
    assert [levels[frame] == ["INFO"] for frame in range(80)] == agreed.both.tolist()
    lane = column(recorded, "/lanes/difference", "StateChange:state")
    assert lane[0] == ["same"]
    assert "other verdict" in lane[agreed.first_parted][0]


def test_rooms_have_colours_of_their_own(recorded, runs):
    rooms = set(runs[0].steps["room"].drop_nulls())
    (names,) = column(recorded, entities.LANE_ROOM, "StateConfiguration:values").values()
    (colors,) = column(recorded, entities.LANE_ROOM, "StateConfiguration:colors").values()
    assert set(names[0] if isinstance(names[0], list) else names) == rooms
    assert len(set(colors)) == len(rooms) > 1


def test_a_pair_is_a_kind_of_recording_of_its_own(recorded):
    from rerun.chunk import RrdReader

    assert {entry.application_id for entry in RrdReader(recorded).recordings()} == {APPLICATION_ID}
    assert APPLICATION_ID != entities.APPLICATION
    assert len(RrdReader(recorded).blueprints()) == 1


def test_partners_have_the_same_colour(runs, tmp_path):
    agreed = agreement(runs[0], runs[0])
    assert agreed is not None
    same = record_pair(tmp_path / "same.rrd", runs[0], runs[0], agreed)
    colors = [
        np.array(list(column(same, f"/lanes/{side}", "StateConfiguration:colors").values()), np.uint32) for side in "ab"
    ]
    present = runs[0].nodes["id"].to_numpy()
    np.testing.assert_array_equal(colors[0][0][present], colors[1][0][present])


def test_a_place_that_cannot_be_written_is_refused(runs, agreed, tmp_path):
    with pytest.raises(ResultError, match="cannot record to"):
        record_pair(tmp_path / "none" / "both.rrd", runs[0], runs[1], agreed)


def test_a_pair_that_cannot_be_written_whole_leaves_the_one_that_is_there(runs, agreed, tmp_path, monkeypatch):
    path = tmp_path / "both.rrd"
    path.write_bytes(b"earlier")

    def full(descriptor, block):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("omnieval.recording.pipe.os.write", full)
    with pytest.raises(ResultError, match=r"cannot write .*both\.rrd: recording stopped: .* No space left"):
        record_pair(path, runs[0], runs[1], agreed)
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [("both.rrd", b"earlier")]


def test_runs_of_two_mappers_are_held_against_each_other_by_their_margins(runs, panoramas, tmp_path):
    other = replay(panoramas, mapper="leader", out=tmp_path / "leader")
    agreed = agreement(runs[0], other)
    assert agreed is not None
    both = record_pair(tmp_path / "both.rrd", runs[0], other, agreed)
    margins = column(both, "/plot/value/b", "Scalars:scalars")
    assert margins[40] == [other.steps["margin"][40]]
