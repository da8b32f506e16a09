"""The rendered building: exact geometry, the tour's promises, the look of the lights."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from omnieval.datasets.synthetic import LIGHTS, MIRROR, camera
from omnieval.datasets.synthetic.day import day_of
from omnieval.datasets.synthetic.drives import drive
from omnieval.datasets.synthetic.first import FIRST, FURNITURE, ROOMS, TWIN_SHIFT, TWINS
from omnieval.datasets.synthetic.furniture import standing
from omnieval.datasets.synthetic.lighting import LIGHTS as DAYS
from omnieval.datasets.synthetic.people import Person, bodies, passers_by
from omnieval.datasets.synthetic.picture import photograph
from omnieval.datasets.synthetic.render import render_polar
from omnieval.datasets.synthetic.scene import build_scene
from omnieval.datasets.synthetic.solids import box

CORRIDOR = (6.5, 0.0, 0.0)
room_of = FIRST.room_at


def furniture(light):
    """What stands in the first building, as solids."""
    return standing(FIRST, day_of(FIRST, light).furniture)


@pytest.fixture(scope="module")
def scene():
    return build_scene(day_of(FIRST, "cloudy"), 1)


@pytest.fixture(scope="module")
def tours():
    return {light: drive(day_of(FIRST, light), 0) for light in LIGHTS}


def difference(a, b):
    return float(np.abs(a.astype(np.float64) - b).mean())


class TestCamera:
    """The mirror: tan e = (sin g0 - sin g) / (cos g0 cos g), g = atan2(F, r), g0 = atan2(F, R_h)."""

    @staticmethod
    def slope_at(radius):
        g, g0 = math.atan2(400.0, radius), math.atan2(400.0, 150.0)
        return (math.sin(g0) - math.sin(g)) / (math.cos(g0) * math.cos(g))

    def radius_of(self, slope):
        return brentq(lambda radius: self.slope_at(radius) - slope, 1.0, 400.0)

    def test_the_horizon_the_floor_and_the_ceiling(self):
        slopes = camera.elevation_slope(np.array([46.0, 150.0, 228.0]))
        assert slopes[0] < -1.0
        assert slopes[1] == pytest.approx(0.0, abs=1e-12)
        assert slopes[2] > 0.35
        assert np.all(np.diff(camera.slopes()) > 0)
        np.testing.assert_allclose(slopes, [self.slope_at(r) for r in (46.0, 150.0, 228.0)], atol=1e-12)

    @pytest.mark.parametrize(
        ("slab", "toward"),
        [
            (box(12.0, 12.1, -1.0, 1.0, 0.2, 1.5, "plastic-red"), (0, -1)),
            (box(9.0, 11.0, 2.0, 2.1, 0.2, 1.5, "plastic-red"), (-1, 0)),
            (box(9.0, 11.0, -2.1, -2.0, 0.2, 1.5, "plastic-red"), (1, 0)),
            (box(7.9, 8.0, -1.0, 1.0, 0.2, 1.5, "plastic-red"), (0, 1)),
        ],
        ids=["ahead is up", "left is left", "right is right", "behind is down"],
    )
    def test_a_slab_appears_where_the_mirror_shows_it(self, scene, slab, toward):
        bare = replace(scene, solids=(slab,))
        image = photograph(render_polar(bare, (10.0, 0.0, 0.0)), bare.light, None)
        radii = np.arange(70, 226)  # further inwards is the robot
        aside = 0.25  # the post stands to the right
        c, s = math.cos(aside), math.sin(aside)
        u = np.rint(MIRROR.cx + (c * toward[0] - s * toward[1]) * radii).astype(int)
        v = np.rint(MIRROR.cy + (s * toward[0] + c * toward[1]) * radii).astype(int)
        blue, green, red = np.moveaxis(image[v, u].astype(int), 1, 0)
        red_radii = radii[red > 2 * np.maximum(blue, green)]
        # The camera is 1 m high and the slab 2 m away.
        expected = self.radius_of((0.2 - 1.0) / 2.0 * c), self.radius_of((1.5 - 1.0) / 2.0 * c)
        assert (red_radii.min(), red_radii.max()) == pytest.approx(expected, abs=2.0)
        assert len(red_radii) == red_radii.max() - red_radii.min() + 1

    def test_the_image_is_black_beyond_the_rim_and_dark_at_its_centre(self, scene):
        image = photograph(render_polar(scene, CORRIDOR), scene.light, None)
        v, u = np.mgrid[0:480, 0:640]
        r = np.hypot(u - MIRROR.cx, v - MIRROR.cy)
        assert image.shape == (480, 640, 3)
        assert image[r > MIRROR.r_out + 2].max() < 10
        assert image[r < MIRROR.r_in - 2].mean() < 40
        assert image[(r > MIRROR.r_in + 2) & (r < MIRROR.r_out - 2)].mean() > 60

    def test_a_turn_of_the_robot_is_a_shift_of_columns(self, scene):
        x, y, yaw = CORRIDOR
        steps = 137
        before = render_polar(scene, (x, y, yaw))
        after = render_polar(scene, (x, y, yaw + 2.0 * math.pi * steps / camera.AZIMUTHS))
        apart = np.abs(np.roll(before, -steps, axis=0) - after).max(axis=2)
        assert np.mean(apart > 2.0) < 0.005  # rounding moves a ray across an edge now and then
        assert difference(before, after) > 10.0

    def test_rim_pixels_are_mixed_by_their_share(self, scene):
        """A level edge that lies in one row moves smoothly through it as the robot moves."""
        slab = box(12.0, 12.1, -5.0, 5.0, 0.0, 1.3, "plastic-red")
        bare = replace(scene, solids=(slab,))
        shown = [render_polar(bare, (10.0 + 0.002 * i, 0.0, 0.0))[0, :, 0].sum() for i in range(60)]
        steps = np.abs(np.diff(shown))
        assert steps.max() < 0.3 * steps.sum()


class TestTour:
    def test_it_is_as_long_as_promised(self, tours):
        for tour in tours.values():
            assert 850 <= len(tour.times) <= 1400

    def test_the_clock_runs_at_about_5_frames_a_second(self, tours):
        for tour in tours.values():
            periods = np.diff(tour.times)
            assert 0.15 < periods.min() <= periods.max() < 0.25
            assert np.ptp(periods) > 0.01

    def test_rooms_are_entered_and_some_twice(self, tours):
        for tour in tours.values():
            codes = [room_of(x, y).code for x, y, _ in tour.poses]
            visits = [code for code, _ in itertools.groupby(codes)]
            assert len({room.code for room in ROOMS} - set(codes)) <= 1
            assert sum(visits.count(room.code) > 1 for room in ROOMS if room.code != "CR") >= 2
            for room in ROOMS:
                depth = [
                    min(x - room.x0, room.x1 - x, y - room.y0, room.y1 - y)
                    for (x, y, _), code in zip(tour.poses, codes, strict=True)
                    if code == room.code
                ]
                assert not depth or max(depth) > 0.7, room.code

    def test_most_of_the_corridor_is_driven_both_ways(self, tours):
        corridor = next(room for room in ROOMS if room.code == "CR")
        assert corridor.x1 - corridor.x0 >= 16.0
        for tour in tours.values():
            x, y, yaw = tour.poses.T
            along = np.abs(y) < 0.6
            for way in (along & (np.cos(yaw) > 0.8), along & (np.cos(yaw) < -0.8)):
                assert len(set(x[way].astype(int))) >= 10


class TestBuilding:
    def test_there_are_ten_rooms_off_a_corridor_and_none_overlap(self):
        assert len({room.code for room in ROOMS}) == len(ROOMS) == 11
        for a, b in itertools.combinations(ROOMS, 2):
            assert a.x1 <= b.x0 or b.x1 <= a.x0 or a.y1 <= b.y0 or b.y1 <= a.y0

    @pytest.mark.parametrize(
        ("place", "code"), [((5.0, 0.0), "CR"), ((4.5, 1.07), "CR"), ((4.5, 1.08), "2PO1"), ((-3.0, 5.0), "1PO")]
    )
    def test_a_doorways_halves_belong_to_the_rooms_they_open_to(self, place, code):
        assert room_of(*place).code == code

    def test_two_rooms_are_alike_on_purpose(self, scene):
        first, second = ([replace(p, room="", along=0.0) for p in FURNITURE if p.room == code] for code in TWINS)
        assert first == second
        inside = render_polar(scene, (5.2, 2.6, 0.4))
        twin = render_polar(scene, (5.2 + TWIN_SHIFT, 2.6, 0.4))
        other = render_polar(scene, (1.7, 2.6, 0.4))
        assert difference(inside, twin) < 0.4 * difference(inside, other)

    def test_other_lights_look_different_and_move_some_furniture(self, scene):
        by_day = render_polar(scene, CORRIDOR)
        night, sunny = (build_scene(day_of(FIRST, light), 1) for light in ("night", "sunny"))
        assert render_polar(night, CORRIDOR).mean() < 0.8 * by_day.mean()
        room = (11.8, -2.6, 0.0)  # before the large windows
        saturated = [np.mean(render_polar(each, room) >= 255.0) for each in (night, scene, sunny)]
        assert saturated[0] < 0.02 < saturated[2]
        assert saturated[1] < saturated[2]
        for light in ("night", "sunny"):
            stayed = set(furniture(light)) & set(furniture("cloudy"))
            assert 0.4 * len(furniture("cloudy")) < len(stayed) < 0.95 * len(furniture("cloudy"))

    def test_the_sun_does_not_shine_through_inner_walls(self):
        """The storage room has no window: its floor is nowhere brighter than on a day without sun patches."""
        lit = render_polar(build_scene(day_of(FIRST, "sunny"), 1), (7.9, -2.2, 0.0))
        floor = lit[:, camera.slopes() < -1.0]
        assert floor.max() < 200.0


class TestPeople:
    def test_people_pass_upright_and_keep_clear_of_the_robot(self, tours):
        for light in LIGHTS:
            people = passers_by(day_of(FIRST, light), 0, tours[light])
            seen = 0
            for capture, (x, y, _) in enumerate(tours[light].poses):
                solids = bodies(people, capture, (x, y))
                seen += bool(solids)
                assert all(math.hypot(s.x - x, s.y - y) - s.width / 2 > 0.2 for s in solids)
            assert 0.2 < seen / len(tours[light].times) < 0.95
            assert {person.step_x > 0.0 for person in people} | {person.step_x < 0.0 for person in people} == {
                True,
                False,
            }
            assert max(s.z1 for p in people for s in bodies((p,), p.start, (0.0, 0.0))) > 1.6

    def test_they_hide_what_is_behind_them(self, scene):
        someone = Person(5, 9, 8.0, 0.0, 0.0, 0.0, ("jeans", "shirt-white"), (0.0, 20.0, -1.0, 1.0))
        x, y = 9.0, 0.0
        assert [len(bodies((someone,), capture, (x, y))) > 0 for capture in (4, 5, 8, 9)] == [False, True, True, False]
        body = bodies((someone,), 5, (x, y))
        apart = np.abs(render_polar(scene, (x, y, math.pi)) - render_polar(scene, (x, y, math.pi), body)).max(axis=2)
        changed = np.flatnonzero((apart > 20.0).any(axis=1))
        assert {0, 10, camera.AZIMUTHS - 10} <= set(changed)
        assert 50 < len(changed) < camera.AZIMUTHS // 2


class TestPictures:
    def test_neighbours_on_the_path_look_most_alike(self, scene, tours):
        """Textures do not flicker: seen along one direction, the next frame is the most similar one."""
        shown = [render_polar(scene, (x, y, 0.0)) for x, y, _ in tours["cloudy"].poses[20:60:4]]
        apart = np.array([[difference(a, b) for b in shown] for a in shown])
        np.fill_diagonal(apart, np.inf)
        assert np.all(np.abs(apart.argmin(axis=1) - np.arange(len(shown))) == 1)

    def test_noise_has_the_days_strength_and_differs_from_frame_to_frame(self, scene):
        polar = render_polar(scene, CORRIDOR)
        clean = photograph(polar, scene.light, None).astype(float)
        noisy = [photograph(polar, scene.light, np.random.default_rng(seed)) for seed in (0, 0, 1)]
        np.testing.assert_array_equal(noisy[0], noisy[1])
        bright = (clean > 30) & (clean < 220)
        # Exposure and contrast curve have amplified it or not.
        assert 0.8 < (noisy[0] - clean)[bright].std() / DAYS["cloudy"].noise < 1.8
        assert np.corrcoef((noisy[0] - clean)[bright], (noisy[2] - clean)[bright])[0, 1] < 0.2
