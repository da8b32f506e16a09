"""The log, the page that says why, and what an image of the map says of itself when it is selected."""

import pytest

from omnieval.recording import entities
from omnieval.recording.pages import why_row, word_rows
from omnieval.recording.styles import EVENT_COLOR, GREY_TEXT_COLOR
from tests.recording.readback import column
from tests.recording.replays import METHOD, by_entity, compared, scene, step, steps
from tests.recording.test_recorder import COUNT, record


def test_refusals_stand_out_in_the_log():
    levels = {a_step.verdict: by_entity(word_rows(a_step, METHOD))[entities.LOG_DECISION].level for a_step in steps(30)}
    assert {verdict for verdict, level in levels.items() if level == "WARN"} == {
        "no-candidate",
        "prominence",
        "centroid",
    }


def labels_of(one):
    """The bold labels of a page, in their order."""
    headline, reasons = why_row(one, METHOD)[1].text.split("\n\n")
    assert headline.startswith("**")
    return [line.split("**")[1] for line in reasons.split("  \n")]


def test_the_page_begins_with_what_would_let_a_refused_image_in_or_with_the_match_of_an_accepted_one():
    closed, refused = (labels_of(scene(steps(30)[frame])) for frame in (15, 20))
    assert refused.index("would flip") < refused.index("best match") < refused.index("prominence")
    assert closed.index("best match") < closed.index("prominence") < closed.index("would flip")


def test_the_page_leaves_out_what_says_nothing():
    count = compared("peaks", [5], 2, reaches=True, counts=True)
    others = compared("match", [0.1, 0.2], 0.5, of=(2, 3))
    closed = steps(30)[15]
    more = step(15, "assigned", closed.role, 1, match=closed.match, comparisons=(*closed.comparisons, count, others))
    assert labels_of(scene(more)) == labels_of(scene(closed))


def test_of_the_nodes_those_that_passed_and_the_nearest_that_did_not_are_named():
    page = why_row(scene(steps(30)[15]), METHOD)[1].text
    assert "passed node 1 at 0.5; refused node 2 at 40" in page


def test_every_line_of_the_log_begins_with_its_step():
    for a_step in steps(60):
        for entity, words in word_rows(a_step, METHOD):
            assert words.text.startswith(f"{a_step.frame}: "), entity


@pytest.mark.parametrize("ground", [0x0D1011FF, 0xFFFFFFFF])
def test_the_log_can_be_read_in_a_dark_and_in_a_bright_viewer(ground):
    assert contrast(GREY_TEXT_COLOR, ground) > 3
    assert contrast(EVENT_COLOR, ground) > 2.5


def contrast(one, other):
    """Contrast of two colours, 1..21 (WCAG 2.1)."""
    bright, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def luminance(color):
    channels = [(color >> shift & 255) / 255 for shift in (24, 16, 8)]
    linear = [channel / 12.92 if channel <= 0.04045 else ((channel + 0.055) / 1.055) ** 2.4 for channel in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("facts") / "replay.rrd"
    record(path, pictures=False)
    return path


def test_an_image_that_is_selected_says_what_it_is_and_what_became_of_it(recorded):
    frames = [str(frame) for frame in range(COUNT)]
    assert column(recorded, entities.MAP_IMAGES, "image") == {None: frames}
    assert column(recorded, entities.MAP_IMAGES, "file")[None][20] == "image-20.jpeg"
    assert column(recorded, entities.MAP_IMAGES, "room")[None][20:31:10] == ["KT", "LR"]
    assert (
        column(recorded, entities.MAP_IMAGES, "decision")[None][20]
        == "refused (prominence): prominence over the mean 3.1 < gamma 5"
    )
    assert column(recorded, entities.MAP_IMAGES, "outcome")[None][19:21] == ["closed", "refused"]
    assert column(recorded, entities.MAP_IMAGES, "best_match_metres")[None][20] == "3.41"
    assert column(recorded, entities.MAP_IMAGES, "final_node")[None][-2:] == ["1", "2"]


def test_the_images_drawn_since_all_were_say_the_same(recorded):
    facts = column(recorded, entities.MAP_RECENT, "image")
    drawn = column(recorded, entities.MAP_IMAGES, "Points2D:positions")
    shown = column(recorded, entities.MAP_RECENT, "Points2D:positions")
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
    assert len(column(path, entities.MAP_IMAGES, "image")[None]) == 30
    assert column(path, entities.MAP_IMAGES, "final_node") == {}


def test_facts_of_images_take_less_than_a_kilobyte_a_step(recorded):
    facts = ("image", "file", "room", "outcome", "decision", "best_match_metres", "final_node")
    size = sum(
        len(text)
        for entity in (entities.MAP_IMAGES, entities.MAP_RECENT)
        for name in facts
        for texts in column(recorded, entity, name).values()
        for text in texts or ()
    )
    assert 0 < size / COUNT < 1000
