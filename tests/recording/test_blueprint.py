"""One blueprint for all recordings, the same for equal runs."""

import rerun.blueprint as rrb

from omnieval.recording import layout
from omnieval.recording.blueprint import build_blueprint


def views(part):
    if isinstance(part, rrb.View):
        return [part]
    return [view for child in part.contents for view in views(child)]


def shown(**options):
    return views(build_blueprint(900, 5.0, **options).root_container)


def test_everything_that_is_recorded_is_shown():
    origins = {view.origin for view in shown()}
    entities = {
        value for name, value in vars(layout).items() if name.isupper() and str(value).startswith("/") and name != "MAP"
    }
    unseen = {
        entity
        for entity in entities
        if not any(entity == origin or entity.startswith(f"{origin}/") for origin in origins)
    }
    assert unseen == set()


def test_equal_blueprints_have_equal_ids_and_no_two_views_share_one():
    first, second = shown(), shown(extent=(0.0, 0.0, 5.0, 5.0))
    assert [view.id for view in first] == [view.id for view in second]
    assert len({view.id for view in first}) == len(first)


def test_the_map_view_looks_at_all_capture_positions():
    (view,) = (view for view in shown(extent=(-2.0, 1.0, 10.0, 5.0)) if view.origin == layout.MAP)
    (bounds,) = view.properties["VisualBounds2D"].as_component_batches()[0].as_arrow_array().to_pylist()
    (x_min, x_max), (y_min, y_max) = bounds["x_range"], bounds["y_range"]
    assert x_min < -2.0 < 10.0 < x_max
    assert y_min < -5.0 < -1.0 < y_max  # the view's y grows downwards


def test_a_file_opens_paused_at_its_steps_and_a_live_view_follows():
    assert build_blueprint(900, 5.0).time_panel.play_state == "paused"
    assert build_blueprint(900, 5.0).time_panel.timeline == layout.STEP
    assert build_blueprint(900, 5.0, play="following").time_panel.play_state == "following"


def lane_window(**options):
    """First and last step that the lanes near the step show, from the step."""
    near = next(view for view in shown(**options) if view.name == "Lanes near the step")
    (window,) = near.properties["TimeAxis"].view_range.as_arrow_array().to_pylist()
    return window["start"], window["end"]


def test_lanes_move_with_the_step_and_a_live_view_shows_what_has_been():
    assert lane_window() == (-layout.NEAR_STEPS, layout.NEAR_STEPS)
    start, end = lane_window(play="following")
    assert end - start == 2 * layout.NEAR_STEPS
    assert start < -layout.NEAR_STEPS < 0 <= end


def test_lanes_near_the_step_come_before_those_of_the_whole_run():
    tabs = [part for part in containers(build_blueprint(900, 5.0).root_container) if isinstance(part, rrb.Tabs)]
    (lanes,) = (part for part in tabs if next(iter(views(part))).origin == layout.LANES)
    assert [view.name for view in lanes.contents] == ["Lanes near the step", "Whole run"]
    assert lanes.active_tab == 0


def test_the_map_is_dark_whatever_the_theme_of_the_desktop():
    (view,) = (view for view in shown() if view.origin == layout.MAP)
    (color,) = view.properties["Background"].color.as_arrow_array().to_pylist()
    assert color == layout.BACKGROUND_COLOR


def containers(part):
    if isinstance(part, rrb.View):
        return []
    return [part, *(child for content in part.contents for child in containers(content))]
