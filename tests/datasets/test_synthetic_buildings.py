"""Buildings by number: plans, days that differ, drives that touch nothing, and what the camera adds."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from omnieval.datasets.registry import canonical
from omnieval.datasets.synthetic import LIGHTS, camera, rendered, synthesize
from omnieval.datasets.synthetic.building import Building, Opening, Room
from omnieval.datasets.synthetic.day import clearances, day_of
from omnieval.datasets.synthetic.drives import SPACING, drive
from omnieval.datasets.synthetic.facts import Rendered
from omnieval.datasets.synthetic.outlines import outlines
from omnieval.datasets.synthetic.picture import photograph
from omnieval.datasets.synthetic.plans import building
from omnieval.datasets.synthetic.render import render_polar
from omnieval.datasets.synthetic.scene import build_scene
from omnieval.datasets.synthetic.solids import box
from omnieval.datasets.synthetic.way import nominal, planned, route
from omnieval.errors import DatasetError

MADE = range(2, 12)
DRIVEN = (1, 2, 3, 4)


def rooms_of(plan):
    return [room for room in plan.rooms if not room.corridor]


@pytest.fixture(scope="module")
def tours():
    return {(n, light): drive(day_of(building(n), light), 0) for n in DRIVEN for light in LIGHTS}


class TestPlans:
    @pytest.mark.parametrize("number", MADE)
    def test_a_plan_holds_together(self, number):
        plan = building(number)
        assert 6 <= len(rooms_of(plan)) <= 14
        assert len({room.code for room in plan.rooms}) == len(plan.rooms)
        for a, b in itertools.combinations(plan.rooms, 2):
            assert a.x1 < b.x0 or b.x1 < a.x0 or a.y1 < b.y0 or b.y1 < a.y0, (a.code, b.code)
        graph = route(plan)
        for first, second in itertools.combinations(rooms_of(plan), 2):
            assert graph.between(graph.doors[first.code], graph.doors[second.code], {})
        assert {"door", "passage", "glass", "window"} == {o.kind for o in plan.openings}
        assert any(room.code.startswith("OP") for room in plan.rooms)

    @pytest.mark.parametrize("number", [1432, 5293, 5854, 6811, 7735])
    def test_the_narrowest_meeting_room_has_its_glass_too(self, number):
        (glass,) = [o for o in building(number).openings if o.kind == "glass"]
        assert glass.end - glass.start > 1.2
        for other in building(number).openings:
            if other is not glass and (other.axis, other.at) == (glass.axis, glass.at):
                assert other.end <= glass.start or glass.end <= other.start

    @pytest.mark.parametrize("number", MADE)
    def test_the_twins_are_alike(self, number):
        plan = building(number)
        first, second = (plan.room(code) for code in plan.twins)
        assert (first.wall, first.floor) == (second.wall, second.floor)
        assert first.x1 - first.x0 == pytest.approx(second.x1 - second.x0)
        assert first.y1 - first.y0 == pytest.approx(second.y1 - second.y0)

        def inside(room):
            return {
                (p.kind, p.wall, round(p.along - (room.x0 if p.wall in "NS" else room.y0), 6))
                for p in plan.furniture
                if p.room == room.code
            }

        assert inside(first) == inside(second) != set()

    def test_numbers_give_other_forms_and_sizes(self):
        plans = [building(n) for n in MADE]
        assert {len([r for r in plan.rooms if r.corridor]) for plan in plans} == {2, 3, 4}
        assert len({len(rooms_of(plan)) for plan in plans}) >= 4
        assert len({plan.footprint for plan in plans}) == len(plans)

    def test_outlines_say_where_rooms_open(self):
        rooms = (
            Room("CR", 0.0, 4.0, 0.0, 2.0, "plaster-dado", "linoleum", ()),
            Room("KT", 0.0, 4.0, 2.15, 6.0, "plaster-dado", "linoleum", ()),
        )
        openings = (Opening("x", 2.075, 1.0, 2.0, "door"), Opening("x", 6.075, 1.0, 2.0, "window"))
        told = json.loads(outlines(Building(7, rooms, openings, (), ("KT", "KT"))))
        assert told["rooms"][1] == {
            "room": "KT",
            "corridor": False,
            "outline": [[0.0, 2.15], [4.0, 2.15], [4.0, 6.0], [0.0, 6.0]],
        }
        assert told["doors"] == [{"rooms": ["CR", "KT"], "kind": "door", "ends": [[1.0, 2.075], [2.0, 2.075]]}]


class TestRoutes:
    def test_a_toll_sends_the_robot_the_other_way_round(self):
        """A ring has four corridors."""
        plan = next(building(n) for n in MADE if "CR4" in {room.code for room in building(n).rooms})
        graph = route(plan)
        start, end = min(graph.links), max(graph.links)
        way = graph.between(start, end, {})
        toll = {frozenset(pair): 50.0 for pair in itertools.pairwise(way)}
        assert graph.between(start, end, toll) != way
        assert graph.between(start, end, toll)[0] == start

    @pytest.mark.parametrize("number", MADE)
    def test_lights_go_in_other_orders_and_one_room_is_seen_in_one_light_only(self, number):
        plan = building(number)
        stops = [planned(plan, light, LIGHTS).stops for light in LIGHTS]
        assert len(set(stops)) == 3
        seen = [set(each) for each in stops]
        assert set.union(*seen) == {room.code for room in rooms_of(plan)}
        assert sum(len(each) for each in seen) == 3 * len(rooms_of(plan)) - 2
        assert all(len(each) > len(set(each)) for each in stops)


class TestDrives:
    def test_no_pose_touches_anything(self, tours):
        for (number, light), tour in tours.items():
            day = day_of(building(number), light)
            solids = [solid for solid in day.solids() if solid.z0 < 1.5 and solid.z1 > 0.05]
            assert clearances(tour.poses[:, :2], solids).min() >= 0.2, (number, light)

    def test_it_stands_still_now_and_then_and_turns_as_a_robot_can(self, tours):
        for tour in tours.values():
            spacing = np.hypot(*np.diff(tour.poses[:, :2], axis=0).T)
            assert 25 < np.count_nonzero(spacing == 0.0) < 100
            assert spacing.max() < 2 * SPACING
            assert np.all(np.diff(tour.times) > 0)
            turns = np.abs((np.diff(tour.poses[:, 2]) + math.pi) % (2 * math.pi) - math.pi)
            assert np.degrees(turns).max() < 45.0

    def test_lights_are_beside_each_other_and_seeds_near_each_other(self, tours):
        def apart(a, b):
            nearest = np.hypot(*(a.poses[:, None, :2] - b.poses[None, :, :2]).transpose(2, 0, 1)).min(axis=1)
            return float(np.median(nearest))

        number = DRIVEN[0]
        again = drive(day_of(building(number), "cloudy"), 1)
        cloudy, night = tours[number, "cloudy"], tours[number, "night"]
        assert 0.02 < apart(again, cloudy) < 0.12
        assert 0.09 < apart(night, cloudy) < 0.4

    def test_a_longer_drive_goes_round_again(self, tours):
        once = tours[2, "cloudy"]
        count = len(once.times)
        long = drive(day_of(building(2), "cloudy"), 0, count + 30)
        np.testing.assert_array_equal(long.poses[:count], once.poses)
        np.testing.assert_array_equal(long.times[:count], once.times)
        assert np.hypot(*(long.poses[count:, :2] - once.poses[:30, :2]).T).max() < 1e-3

    def test_the_way_is_closed_and_everything_stands_clear_of_it(self):
        plan = building(2)
        way = nominal(plan, planned(plan, "night", LIGHTS))
        steps = np.hypot(*np.diff(way, axis=0, append=way[:1]).T)
        assert steps.max() < 0.05


class TestDays:
    def test_doors_chairs_and_boxes_move_but_cupboards_do_not(self):
        plan = building(2)
        days = {light: day_of(plan, light) for light in LIGHTS}

        def places(light, kind):
            return {(p.room, p.along, p.gap, p.turn) for p in days[light].furniture if p.kind == kind}

        assert places("cloudy", "cupboard") == places("night", "cupboard")
        for kind in ("leaf", "chair", "boxes"):
            assert places("cloudy", kind) != places("night", kind)

    def test_what_has_no_window_keeps_its_lamps(self):
        for number in MADE:
            plan = building(number)
            day = day_of(plan, "sunny")
            windows = [o for o in plan.openings if o.kind == "window"]
            for code in day.dark:
                room = plan.room(code)
                middles = [((o.start + o.end) / 2, o.at) for o in windows]
                ends = [(m, at) if o.axis == "x" else (at, m) for o, (m, at) in zip(windows, middles, strict=True)]
                assert any(room.distance(*place) < 0.2 for place in ends)


class TestCamera:
    def test_post_and_body_stay_put_while_the_world_turns(self):
        scene = build_scene(day_of(building(2), "cloudy"), 2)
        x, y, _ = drive(day_of(building(2), "cloudy"), 0, 30).poses[20]
        shown = [photograph(render_polar(scene, (x, y, yaw)), scene.light, None) for yaw in (0.0, 1.0, 2.5)]
        cover = np.zeros((camera.HEIGHT, camera.WIDTH), bool)
        mount = camera.mount()
        cover[camera.DISC][mount.where] = mount.uncovered[..., 0] < 0.01
        disc = np.zeros_like(cover)
        disc[camera.DISC] = camera.rim()[..., 0] > 0.5
        spread = np.ptp(np.stack(shown).astype(float).mean(axis=3), axis=0)
        assert 0.02 < cover.sum() / disc.sum() < 0.12
        assert np.median(spread[cover]) < 6.0 < 15.0 < np.median(spread[disc & ~cover])

    def test_the_exposure_brings_a_dim_room_near_a_bright_one(self):
        scene = build_scene(day_of(building(2), "night"), 2)
        polar = render_polar(scene, (*drive(day_of(building(2), "night"), 0, 2).poses[1, :2], 0.0))
        bright, dim = (photograph(polar * share, scene.light, None).mean() for share in (1.0, 0.5))
        assert dim > 0.85 * bright

    def test_a_turn_smears_the_picture_and_a_straight_way_does_not(self):
        scene = build_scene(day_of(building(2), "night"), 2)
        polar = render_polar(scene, (*drive(day_of(building(2), "night"), 0, 2).poses[1, :2], 0.0))
        still, turning = (photograph(polar, scene.light, None, turned).astype(float) for turned in (0.0, 0.5))
        assert np.abs(np.diff(turning, axis=1)).sum() < 0.97 * np.abs(np.diff(still, axis=1)).sum()

    def test_the_sun_falls_through_a_window_onto_the_floor_behind_it(self):
        """Towards the sun: x + 0.45, y - 1, z + 0.75. From (2.1, 2, 0) the line leaves at x = 3 and z = 1.5."""
        rooms = (Room("KT", 0.0, 6.0, 0.0, 6.0, "plaster-cream", "concrete", ()),)
        window = Opening("x", -0.075, 2.0, 4.0, "window", 1.2, 2.1)
        sunny = replace(day_of(building(2), "sunny"), building=Building(9, rooms, (window,), (), ("KT", "KT")))
        sunny = replace(sunny, furniture=(), dark=frozenset())
        overcast = replace(sunny, light=replace(sunny.light, sun=0.0))
        with_sun, without = (render_polar(build_scene(day, 0), (2.3, 2.0, math.pi))[0] for day in (sunny, overcast))
        lit = np.flatnonzero((with_sun - without).sum(axis=1) > 20.0)
        ahead = -camera.EYE / camera.slopes()[lit]
        ahead = ahead[ahead > 0.0]
        # West of the robot, on the floor; the window ends at x = 2, which is met from x = 2 - 0.45 * 2.075.
        assert ahead.size > 3
        assert ahead.max() == pytest.approx(2.3 - (2.05 - 0.45 * 2.075), abs=0.12)

    def test_a_shiny_floor_mirrors_what_is_beyond_it(self):
        rooms = (Room("KT", 0.0, 12.0, 0.0, 6.0, "plaster-cream", "tiles-large", ()),)
        day = replace(day_of(building(2), "cloudy"), building=Building(9, rooms, (), (), ("KT", "KT")), furniture=())
        scene = build_scene(day, 0)
        red = box(9.0, 9.1, 2.0, 4.0, 0.6, 1.6, "plastic-red")
        with_red = replace(scene, solids=(*scene.solids, red))
        before, after = (render_polar(each, (6.0, 3.0, 0.0))[0] for each in (scene, with_red))
        floor = np.flatnonzero((camera.slopes() < -0.15) & (camera.slopes() > -0.25))
        assert (after[floor, 0] < before[floor, 0] - 1.0).any()


class TestSources:
    @pytest.mark.parametrize(
        ("text", "source", "name"),
        [
            ("", "synthetic:cloudy", "synthetic-cloudy"),
            ("night", "synthetic:night", "synthetic-night"),
            ("night:1", "synthetic:night", "synthetic-night"),
            ("sunny:12", "synthetic:sunny:12", "synthetic-sunny-12"),
            (":3", "synthetic:cloudy:3", "synthetic-cloudy-3"),
        ],
    )
    def test_a_building_is_named_once(self, text, source, name):
        which = rendered(text)
        assert (which.source, which.name) == (source, name)
        assert canonical(f"synthetic:{text}") == source

    @pytest.mark.parametrize(
        "text", ["night:0", "night:x", "night:", "night:-2", "night:10000", "night:3:4", "night:\u0663"]
    )
    def test_other_buildings_are_refused(self, text):
        with pytest.raises(DatasetError, match="no building"):
            rendered(text)

    def test_same_bytes_on_one_worker_and_two_and_the_outlines_lie_beside_them(self, tmp_path):
        one = synthesize(tmp_path / "one", light="night", building=3, frames=3, workers=1)
        two = synthesize(tmp_path / "two", light="night", building=3, frames=3, workers=2)
        files = [path.relative_to(one) for path in sorted(one.rglob("*")) if path.is_file()]
        assert len(files) == 5
        assert all((one / name).read_bytes() == (two / name).read_bytes() for name in files)
        assert json.loads((one / "building.json").read_text())["building"] == 3

    def test_a_building_that_is_not_there_is_refused(self, tmp_path):
        with pytest.raises(DatasetError, match="no synthetic building 0"):
            synthesize(tmp_path / "out", building=0)
        assert Rendered("night", 3).words == ("night", "3")
