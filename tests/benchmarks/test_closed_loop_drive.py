"""Whole drives: the planner stops in time where a fixed speed does not."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.closed_loop.course import Course
from benchmarks.closed_loop.drive import run_drive
from benchmarks.closed_loop.film import film_poses
from benchmarks.closed_loop.metrics import summary
from benchmarks.closed_loop.moving_horizon import MovingHorizon
from benchmarks.closed_loop.policies import FixedSpeed
from benchmarks.closed_loop.quad import LIMITS, QUAD, ROLLING
from benchmarks.closed_loop.route import LENGTH, STEEPEST
from benchmarks.closed_loop.scenes import scene
from slopewise.models.parameters import Braking, Model

SCENES = (0, 3)


@pytest.fixture
def cautious() -> Model:
    """Weaker than the brakes are on any surface, so nothing has to be learned first."""
    braking = Braking(
        m_m=0.0,
        b_m=0.0,
        m_b=0.0,
        b_b=0.40,
        dead_time=0.2,
        distance_offset=0.25,
        speed_range=(0.8, 4.2),
        grade_range=(-0.4, 0.4),
    )
    return Model(name="cautious", vehicle=QUAD, braking=braking, terrain=ROLLING, limits=LIMITS)


def test_the_planner_stops_before_walls_and_unknown_ground(cautious: Model) -> None:
    drives = [run_drive(*scene(n, None), MovingHorizon(cautious), n) for n in SCENES]
    found = summary(drives, drives)
    assert found["finished"] == len(SCENES)
    assert found["forced_stops"] >= 3
    assert found["collisions"] == 0
    assert found["past_clear"] == 0
    assert found["covered"] == 1.0
    assert found["least_load"] > LIMITS.min_load
    assert found["track_error"] < 0.4


def test_a_fixed_speed_hits_walls_in_the_same_world(cautious: Model) -> None:
    hits = 0
    for n in SCENES:
        terrain, route, _ = scene(n, None)
        course = Course(route, np.random.default_rng(n), only_forced=True, sight=(1.2, 2.0))
        hits += run_drive(terrain, route, course, FixedSpeed(cautious, 3.5), n).collisions
    assert hits > 0


def test_a_film_shows_the_wall_and_the_vehicle_before_it(cautious: Model) -> None:
    poses = film_poses(SCENES[0], None, MovingHorizon(cautious), 3)
    assert len(poses) == 3
    for pose in poses:
        vehicle, wall = pose.joints[:3], pose.places[-1]
        assert pose.places.shape[1:] == (3,)
        assert 0.5 < np.hypot(*(wall - vehicle)[:2]) < LENGTH
        assert wall[2] > -1.0  # it waits far below while it is not needed


def test_a_scene_is_the_same_for_every_policy() -> None:
    one, other = scene(4, None), scene(4, None)
    assert np.array_equal(one[0].height, other[0].height)
    assert np.array_equal(one[1].station, other[1].station)
    assert one[2].happenings == other[2].happenings


@pytest.mark.parametrize("number", range(6))
def test_a_course_never_tells_more_than_is_free(number: int) -> None:
    _, route, course = scene(number, None)
    assert np.abs(route.grade).max() <= STEEPEST
    told = [course.told(s, foresight=False) for s in np.linspace(0.0, route.length, 80)]
    standing = [h for h in course.happenings if h.kind == "obstacle"]
    assert np.all(np.diff(told) >= -1e-9)
    for obstacle in standing:
        assert max(told) <= obstacle.barrier
    for h in course.happenings:
        if h.kind == "forced":
            assert h.barrier <= course.reach(h.trigger) + 1e-9
            assert course.told(0.0, foresight=True) <= h.barrier
