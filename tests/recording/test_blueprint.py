"""One blueprint for all recordings, the same for equal runs."""

import pytest
import rerun.blueprint as rrb

from omnieval.mapping.interface import Column, Method
from omnieval.recording import entities
from omnieval.recording.blueprint import build_blueprint
from omnieval.recording.charts import Charts
from omnieval.recording.styles import BACKGROUND_COLOR, series
from tests.recording.replays import LEADER, METHOD, steps


def views(part):
    if isinstance(part, rrb.View):
        return [part]
    return [view for child in part.contents for view in views(child)]


def shown(method=METHOD, **options):
    return views(build_blueprint(method, 900, **options).root_container)


@pytest.mark.parametrize("method", [METHOD, LEADER, Method(name="silent")])
def test_everything_that_is_recorded_is_shown_and_nothing_else(method):
    origins = {view.origin for view in shown(method)}
    recorded = {
        value
        for name, value in vars(entities).items()
        if name.isupper() and str(value).startswith("/") and name != "MAP"
    }
    recorded -= {entities.CURVES, entities.PLOT_GATES, entities.PLOT_COLUMNS}
    recorded -= {entities.BARS, entities.PASSING, entities.REFUSED, entities.BAND}
    own = {entity for entity, _ in Charts(method).step_rows(steps(1)[0])} | set(series(method))
    assert {one for one in recorded | own if not any(one == at or one.startswith(f"{at}/") for at in origins)} == set()
    assert {at for at in origins if not any(one == at or one.startswith(f"{at}/") for one in recorded | own)} == set()


def test_titles_are_the_words_of_the_mapper():
    names = {view.name for view in shown()}
    assert {"Similarity", "Position", "Orientation", "Gate ratio of each node; x is the band"} <= names
    assert {"Prominence over the mean, gamma, missed", "Shift of the node's mean, bound", "Gate ratio, x"} <= names
    assert "Relative distance, radius, missed" in {view.name for view in shown(LEADER)}
    own = Method(name="own", columns=(Column(name="t", type="float", meaning="time", unit="s", plotted=True),))
    assert "Time, s" in {view.name for view in shown(own)}


def test_equal_blueprints_have_equal_ids_and_no_two_views_share_one():
    first, second = shown(), shown(extent=(0.0, 0.0, 5.0, 5.0))
    assert [view.id for view in first] == [view.id for view in second]
    assert len({view.id for view in first}) == len(first)


def test_the_map_view_looks_at_all_capture_positions():
    (view,) = (view for view in shown(extent=(-2.0, 1.0, 10.0, 5.0)) if view.origin == entities.MAP)
    (bounds,) = view.properties["VisualBounds2D"].as_component_batches()[0].as_arrow_array().to_pylist()
    (x_min, x_max), (y_min, y_max) = bounds["x_range"], bounds["y_range"]
    assert x_min < -2.0 < 10.0 < x_max
    assert y_min < -5.0 < -1.0 < y_max  # the view's y grows downwards


def test_a_file_opens_paused_at_its_steps_and_a_live_view_follows():
    assert build_blueprint(METHOD, 900).time_panel.play_state == "paused"
    assert build_blueprint(METHOD, 900).time_panel.timeline == entities.STEP
    assert build_blueprint(METHOD, 900, play="following").time_panel.play_state == "following"


def lane_window(**options):
    """First and last step that the lanes near the step show, from the step."""
    near = next(view for view in shown(**options) if view.name == "Lanes near the step")
    (window,) = near.properties["TimeAxis"].view_range.as_arrow_array().to_pylist()
    return window["start"], window["end"]


def test_lanes_move_with_the_step_and_a_live_view_shows_what_has_been():
    assert lane_window() == (-entities.NEAR_STEPS, entities.NEAR_STEPS)
    start, end = lane_window(play="following")
    assert end - start == 2 * entities.NEAR_STEPS
    assert start < -entities.NEAR_STEPS < 0 <= end


def test_lanes_near_the_step_come_before_those_of_the_whole_run():
    tabs = [part for part in containers(build_blueprint(METHOD, 900).root_container) if isinstance(part, rrb.Tabs)]
    (lanes,) = (part for part in tabs if next(iter(views(part))).origin == entities.LANES)
    assert [view.name for view in lanes.contents] == ["Lanes near the step", "Whole run"]
    assert lanes.active_tab == 0


def test_the_map_is_dark_whatever_the_theme_of_the_desktop():
    (view,) = (view for view in shown() if view.origin == entities.MAP)
    (color,) = view.properties["Background"].color.as_arrow_array().to_pylist()
    assert color == BACKGROUND_COLOR


def containers(part):
    if isinstance(part, rrb.View):
        return []
    return [part, *(child for content in part.contents for child in containers(content))]
