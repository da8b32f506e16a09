"""A recording holds every step, in one layout, and never stands in the way of the replay."""

import dataclasses
import os
from pathlib import Path

import pytest
import rerun as rr
from rerun.chunk import RrdReader

from omnieval.errors import ConfigError, ResultError
from omnieval.mapping.step import Role
from omnieval.recording import RecordingOptions, entities
from omnieval.recording.charts import Charts
from omnieval.recording.digest import digest
from omnieval.recording.recorder import Recorder
from omnieval.recording.styles import room_color, series
from omnieval.recording.viewer import check_recording
from tests.recording.readback import column, rows_per_entity, static_entities
from tests.recording.replays import LEADER, METHOD, final, image, images, info, picture, step, steps

COUNT = 120

EVERY_STEP = {
    entities.LOG_DECISION,
    entities.WHY,
    entities.MAP_RECENT,
    entities.MAP_ROBOT,
    entities.MAP_HEADING,
    entities.MAP_NODES,
} | set(series(METHOD))
PICTURES = {entities.PANORAMA, entities.OMNIDIRECTIONAL, entities.BEST_MATCH}
CURVES = {entity for entity, _ in Charts(METHOD).step_rows(steps(1)[0])}
MISSED = "/plot/gate/prominence/missed"


def log(recorder, a_step, *, pictures=None, milliseconds=1.5, silhouette: float | None = 0.25, **surroundings):
    recorder.log(a_step, image(a_step.frame, **surroundings), milliseconds, silhouette=silhouette, pictures=pictures)


def record(path, *, count=COUNT, options=None, pictures=True, finished=True, changes=None, **surroundings):
    """Record a made-up replay of `count` steps."""
    with Recorder(path, info(count, **(changes or {})), options) as recorder:
        for a_step in steps(count):
            wanted = pictures and recorder.wants_images(a_step.frame)
            log(recorder, a_step, pictures=images(a_step) if wanted else None, **surroundings)
        if finished:
            recorder.finish(final([1] * (count - 1) + [2]), "# made-up\n\nafter")
    return recorder


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "replay.rrd"
    assert record(path).failure is None
    return path


def test_every_step_is_there(recorded):
    rows = rows_per_entity(recorded)
    assert check_recording(recorded) == COUNT
    for entity in (EVERY_STEP | PICTURES | CURVES) - {entities.MAP_RECENT, entities.MAP_NODES}:
        assert rows[entity] == COUNT, entity
    assert len(column(recorded, entities.MAP_RECENT, "Points2D:positions")) == COUNT + 1  # the final map
    assert rows[entities.MAP_NODES] == COUNT + 1


def test_events_and_changes_are_there_when_they_happen(recorded):
    rows = rows_per_entity(recorded)
    replay = steps(COUNT)
    assert rows[entities.LOG_EVENT] == sum(len(a_step.events) for a_step in replay) + 1  # the final map
    rooms = column(recorded, entities.LANE_ROOM, "StateChange:state")
    assert rooms == {0: ["KT"], 30: ["LR"], 60: ["KT"], 90: ["LR"]}
    lane = column(recorded, entities.LANE_NODE, "StateChange:state")
    assert [lane[frame] for frame in (0, 20, 23, 24, 29)] == [["1"], ["unassigned"], ["1"], ["unassigned"], ["2"]]
    assert column(recorded, entities.LANE_FINAL, "StateChange:state") == {0: ["1"], COUNT - 1: ["2"]}


def test_every_room_has_a_colour_of_its_own_that_does_not_change(recorded):
    lanes = [chunk for chunk in RrdReader(recorded).stream() if chunk.entity_path == entities.LANE_ROOM]
    named = [
        dict(zip(names, colors, strict=True))
        for batch in (chunk.to_record_batch() for chunk in lanes if chunk.is_static)
        for names, colors in zip(
            batch.column("StateConfiguration:values").to_pylist(),
            batch.column("StateConfiguration:colors").to_pylist(),
            strict=True,
        )
    ]
    assert {"KT": room_color(0), "LR": room_color(1)} in named
    assert all(colors["KT"] == room_color(0) for colors in named)
    assert len({room_color(index) for index in range(30)}) == 30


def test_words_in_the_recording_give_the_reason(recorded):
    said = column(recorded, entities.LOG_DECISION, "TextLog:text")
    assert said[20] == ["20: refused (prominence): prominence over the mean 3.1 < gamma 5"]
    assert said[24] == ["24: refused (no-candidate): gate ratio of node 1: 2.31 > x 1.85"]
    events = column(recorded, entities.LOG_EVENT, "TextLog:text")
    assert events[29] == ["29: created node 2 from images 24-29"]
    assert events[COUNT][0].startswith(f"{COUNT}: final map: 2 nodes")


def test_the_page_of_a_step_says_what_would_have_turned_it_and_where_the_match_was_taken(recorded):
    pages = column(recorded, entities.WHY, "TextDocument:text")
    (refused,) = pages[20]
    assert refused.startswith("**refused (prominence): prominence over the mean 3.1 < gamma 5**")
    assert "gamma <= 3.1 would pass this gate" in refused
    assert "**best match** 0 of node 1 in KT, 3.41 m away, turned by 3 cells (4.2 deg)" in refused
    (far,) = pages[24]
    assert "omega >= 2.31 would make node 1 a candidate" in far


def test_every_loop_closure_is_recorded_once_and_a_node_says_what_it_holds(recorded):
    verdicts = [a_step.verdict for a_step in steps(COUNT)]
    rows = rows_per_entity(recorded)
    assert rows[entities.MAP_ACCEPTED] == verdicts.count("assigned")
    assert rows[entities.MAP_REFUSED] == verdicts.count("prominence") + verdicts.count("centroid")
    assert column(recorded, entities.MAP_NODES, "rooms")[9] == ["KT 100 %"]
    assert column(recorded, entities.MAP_NODES, "images")[15] == ["16"]


def test_missed_loop_closures_are_marked_in_the_plot_of_prominences(tmp_path):
    path, count = tmp_path / "replay.rrd", 160  # the robot has been everywhere after 126 steps
    record(path, count=count, pictures=False)
    states = column(path, entities.LANE_DECISION, "StateChange:state")
    marks = column(path, MISSED, "Scalars:scalars")
    state, missed = "", []
    for frame in range(count):
        (state,) = states.get(frame, [state])
        missed += [frame] if state == "missed" else []
    assert missed
    assert sorted(marks) == missed
    assert {ratio for (ratio,) in marks.values()} == {0.0, 3.1, 8.0}  # no candidate, prominence, centroid


def test_numbers_in_the_recording_are_those_of_the_step(recorded):
    prominence = column(recorded, "/plot/gate/prominence/value", "Scalars:scalars")
    assert prominence[20] == [3.1]
    assert prominence[15] == [8.0]


def test_the_layout_is_the_same_whatever_the_run(recorded, tmp_path):
    other = tmp_path / "other.rrd"
    record(
        other,
        count=45,
        options=RecordingOptions(every=3),
        changes={"name": "elsewhere", "method": METHOD.model_copy(update={"settings": {"gamma": 2.0}}), "cells": 64},
    )
    assert set(rows_per_entity(other)) == set(rows_per_entity(recorded))
    assert static_entities(other) == static_entities(recorded)
    ids = {entry.application_id for path in (other, recorded) for entry in RrdReader(path).recordings()}
    assert ids == {"omnieval roman2020"}


def test_each_mapper_has_its_own_layout_and_no_word_of_another(recorded, tmp_path):
    path = tmp_path / "leader.rrd"
    record(path, count=40, changes={"method": LEADER})
    entry, *_ = RrdReader(path).recordings()
    assert entry.application_id == "omnieval leader"
    seen = set(rows_per_entity(path)) | static_entities(path)
    assert "/plot/gate/distance/value" in seen
    assert not {entity for entity in seen if "prominence" in entity or entity.startswith("/curve")}


def test_the_page_ends_with_the_metrics_and_begins_with_the_configuration(recorded, tmp_path):
    assert list(column(recorded, entities.PAGE, "TextDocument:text").values()) == [["# made-up\n\nafter"]]
    cut_short = tmp_path / "cut.rrd"
    record(cut_short, finished=False)
    assert list(column(cut_short, entities.PAGE, "TextDocument:text").values()) == [["# made-up\n\nbefore"]]


def test_the_recording_brings_its_blueprint_and_says_what_it_is(recorded):
    reader = RrdReader(recorded)
    assert len(reader.blueprints()) == 1
    assert [entry.recording_id for entry in reader.recordings()] == ["a-run"]
    assert list(column(recorded, "/__properties", "RecordingInfo:name").values()) == [["made-up - hog"]]
    assert list(column(recorded, "/__properties/run", "omega").values()) == [["2.0"]]


def test_equal_replays_have_equal_digests_though_not_equal_bytes(recorded, tmp_path):
    again = tmp_path / "again.rrd"
    record(again, changes={"recording_id": "another-run"})
    assert digest(again) == digest(recorded)
    assert again.read_bytes() != recorded.read_bytes()


def test_measured_times_do_not_change_the_digest_but_one_decision_does(recorded, tmp_path):
    def replay(path, replay_steps, milliseconds):
        with Recorder(path, info(len(replay_steps))) as recorder:
            for a_step in replay_steps:
                log(recorder, a_step, milliseconds=milliseconds)
        return digest(path)

    usual = steps(40)
    other = [*usual[:-1], step(39, "assigned", Role.JOINED, 1)]
    assert replay(tmp_path / "a.rrd", usual, 1.0) == replay(tmp_path / "b.rrd", usual, 9.0)
    assert replay(tmp_path / "a.rrd", usual, 1.0) != replay(tmp_path / "c.rrd", other, 1.0)


def test_a_step_with_pictures_takes_at_most_60_kilobytes(tmp_path):
    path = tmp_path / "replay.rrd"
    replay = steps(40)
    with Recorder(path, info(len(replay))) as recorder:
        for a_step in replay:
            log(recorder, a_step, pictures=images(a_step, shape=(128, 512, 3), omnidirectional=(480, 640, 3)))
    assert 10_000 < path.stat().st_size / len(replay) <= 60_000


def test_without_pictures_a_step_takes_little(tmp_path):
    path = tmp_path / "replay.rrd"
    record(path, count=400, options=RecordingOptions(images=False))
    assert path.stat().st_size / 400 < 6_000


def test_pictures_can_be_left_out(tmp_path):
    path = tmp_path / "replay.rrd"
    recorder = record(path, options=RecordingOptions(images=False))
    assert not recorder.wants_images(0)
    rows = rows_per_entity(path)
    assert not PICTURES & set(rows)
    assert all(rows[entity] == COUNT for entity in CURVES)


def test_pictures_that_are_not_wanted_are_not_recorded_even_if_given(tmp_path):
    path = tmp_path / "replay.rrd"
    with Recorder(path, info(2), RecordingOptions(images=False)) as recorder:
        for a_step in steps(2):
            log(recorder, a_step, pictures=images(a_step))
    assert not PICTURES & set(rows_per_entity(path))


def test_every_kth_picture_and_curve_but_every_number_and_word(tmp_path):
    path = tmp_path / "replay.rrd"
    record(path, options=RecordingOptions(every=7))
    rows = rows_per_entity(path)
    assert all(rows[entity] == len(range(0, COUNT, 7)) for entity in PICTURES | CURVES)
    assert all(rows[entity] == COUNT for entity in {entities.LOG_DECISION} | set(series(METHOD)))


def test_without_poses_rooms_and_times_the_rest_is_complete(tmp_path):
    path = tmp_path / "replay.rrd"
    recorder = record(path, poses=False, room=False, silhouette=None, changes={"extent": None})
    assert recorder.failure is None
    rows = rows_per_entity(path)
    missing = {entities.MAP_ROBOT, entities.MAP_HEADING, entities.MAP_TRAIL, entities.MAP_MATCH, entities.MAP_NODES}
    missing |= {entities.MAP_TRANSITIONS, entities.MAP_ACCEPTED, entities.MAP_REFUSED, entities.LANE_ROOM}
    assert not missing & set(rows)
    assert all(rows[entity] == COUNT for entity in (EVERY_STEP | PICTURES | CURVES) - missing - {entities.MAP_RECENT})
    assert rows[entities.GRAPH] > 1
    assert rows_per_entity(path, entities.CAPTURE) == {}


def test_panoramic_input_has_no_omnidirectional_image(tmp_path):
    path = tmp_path / "replay.rrd"
    with Recorder(path, info(3)) as recorder:
        for a_step in steps(3):
            log(recorder, a_step, pictures=images(a_step, omnidirectional=None))
    rows = rows_per_entity(path)
    assert entities.PANORAMA in rows
    assert entities.OMNIDIRECTIONAL not in rows


def test_the_match_is_cleared_when_there_is_none(recorded):
    blobs = column(recorded, entities.BEST_MATCH, "EncodedImage:blob")
    assert blobs[24] == []
    assert len(blobs[15]) == 1


def test_mixed_capture_times_are_kept_where_known(tmp_path):
    path = tmp_path / "replay.rrd"
    with Recorder(path, info(30)) as recorder:
        for a_step in steps(30):
            log(recorder, a_step, poses=a_step.frame % 2 == 0)
    assert rows_per_entity(path)[entities.LOG_DECISION] == 30
    assert rows_per_entity(path, entities.CAPTURE)[entities.LOG_DECISION] == 15


def test_the_file_has_its_name_only_when_it_is_whole(tmp_path):
    path, partial = tmp_path / "replay.rrd", tmp_path / "replay.partial.rrd"
    recorder = Recorder(path, info(60))
    for a_step in steps(60):
        log(recorder, a_step)
    assert partial.exists()
    assert not path.exists()
    recorder.close()
    recorder.close()
    assert path.exists()
    assert not partial.exists()


def test_a_replay_that_was_interrupted_leaves_a_whole_recording_of_its_steps(tmp_path):
    path = tmp_path / "replay.rrd"

    def interrupted():
        with Recorder(path, info(60)) as recorder:
            for a_step in steps(7):
                log(recorder, a_step)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert check_recording(path) == 7


def test_strictness_towards_rerun_is_nobody_elses_business(tmp_path):
    before = rr.strict_mode()
    record(tmp_path / "replay.rrd", count=12)
    assert rr.strict_mode() == before


@pytest.mark.parametrize("name", ["missing/replay.rrd", "."])
def test_a_path_that_cannot_be_written_is_refused_at_once(tmp_path, name):
    with pytest.raises(ResultError, match="cannot record to"):
        Recorder(tmp_path / name, info(5))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_ends_the_recording_and_nothing_else(tmp_path):
    (tmp_path / "replay.partial.rrd").symlink_to("/dev/full")
    with Recorder(tmp_path / "replay.rrd", info(COUNT)) as recorder:
        for a_step in steps(COUNT):
            log(recorder, a_step, pictures=images(a_step) if recorder.wants_images(a_step.frame) else None)
        assert not recorder.wants_images(0)
        recorder.finish(final([1] * COUNT), "after")
    assert recorder.failure is not None
    assert os.strerror(28) in recorder.failure
    assert not (tmp_path / "replay.rrd").exists()


def test_what_rerun_cannot_take_ends_the_recording_and_nothing_else(tmp_path):
    bad = dataclasses.replace(image(0), room="\udcff")  # a file name that is no text
    with Recorder(tmp_path / "bad.rrd", info(COUNT)) as recorder:
        recorder.log(steps(1)[0], bad, 1.5)
    assert recorder.failure is not None
    assert recorder.failure.startswith("recording stopped: ")
    assert not (tmp_path / "bad.rrd").exists()


def test_steps_are_recorded_in_order(tmp_path):
    with Recorder(tmp_path / "replay.rrd", info(5)) as recorder, pytest.raises(ValueError, match="expected frame 0"):
        log(recorder, steps(5)[3])


@pytest.mark.parametrize(
    ("options", "wrong"),
    [({"every": 0}, "at least 1"), ({"spawn": True, "connect": "rerun+http://127.0.0.1:9/proxy"}, "choose")],
)
def test_options_that_contradict_are_refused(options, wrong):
    with pytest.raises(ConfigError, match=wrong):
        RecordingOptions(**options)


def test_a_recording_needs_somewhere_to_go():
    with pytest.raises(ResultError, match="somewhere to go"):
        Recorder(None, info(5))


def test_a_rerun_that_is_switched_off_is_not_taken_for_a_recording(tmp_path, monkeypatch):
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(ResultError, match="switched off"):
        Recorder(tmp_path / "replay.rrd", info(5))
    assert list(tmp_path.iterdir()) == []


def test_a_picture_of_the_helpers_is_as_detailed_as_a_photograph():
    assert picture((128, 512, 3), 0).std() > 30
