"""The guard's own stops: compared with closed forms, with the checker's, and with each other."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.path_force import path_force_along
from slopewise.services.check.path_ground import ground_under
from slopewise.services.check.plan_line import line_of
from slopewise.services.check.stop_dynamics import StopDynamics
from slopewise.services.check.stop_integration import StopStarts, worst_case_stops
from slopewise.services.guard.guard_model import GuardModel, GuardScene
from slopewise.services.guard.stop_courses import Course, Pose2d, StopCourses, courses_ahead
from slopewise.services.guard.stop_distances import StopOutcomes, stops_along
from slopewise.services.io.model_file import read_model
from tests.services.guard.guard_fixtures import ATV, CELL, MODEL, hills, slope

G = 9.80665
ORIGIN = Pose2d(0.0, 0.0, 0.0)


def with_brakes(**numbers: float) -> GuardModel:
    """The quad with other brakes, everywhere."""
    (table,) = MODEL.tables
    columns = {name: np.full_like(table.b_b, value) for name, value in numbers.items()}
    return MODEL._replace(tables=(table._replace(**columns),))


def arc_on(
    model: GuardModel,
    ground: ElevationMap,
    pose: Pose2d = ORIGIN,
    curvature: float = 0.0,
    *,
    forward: bool = True,
) -> StopCourses:
    """The one course of a turn that is held, left positive."""
    course = Course(1.0, curvature, curvature, curvature, forward=forward)
    return courses_ahead(GuardScene(model, ground, np.inf), pose, course, 15.0)


def stops(
    model: GuardModel, arc: StopCourses, speed: float, held: float = 0.0, load: float = 0.0
) -> StopOutcomes:
    return stops_along(model, arc, np.array([speed]), np.array([held]), load)


def stop_from(model: GuardModel, arc: StopCourses, speed: float, held: float = 0.0) -> float:
    return float(stops(model, arc, speed, held).distance[0])


@pytest.mark.parametrize("grade", [-0.2, -0.1, 0.0, 0.1, 0.2])
@pytest.mark.parametrize("speed", [0.5, 1.0, 2.5, 4.0])
def test_stop_on_an_even_slope_is_that_of_the_closed_form(grade: float, speed: float) -> None:
    """Braking (2), (7), (8), (12) by hand, the drive cut in the dead time where that is worse."""
    dead, resistance = 0.30, 0.13
    gain = max(-np.sin(grade) - resistance, 0.0)
    onset = np.sqrt(speed**2 + 2.0 * G * gain * speed * dead)
    v = max(onset, 1.0)
    force = (-0.03 * v - 0.35) * grade + 0.015 * v + 0.40
    by_hand = speed * dead + onset**2 / (2.0 * G * (force + np.sin(grade))) + 0.20
    distance = stop_from(MODEL, arc_on(MODEL, slope(grade)), speed)
    assert by_hand - 1e-6 <= distance <= by_hand * 1.02 + 0.01


@pytest.mark.parametrize("heading", [0.0, 1.2, -2.5])
@pytest.mark.parametrize("curvature", [-0.3, 0.2])
def test_an_arc_lies_on_its_circle_with_the_slopes_along_it(
    heading: float, curvature: float
) -> None:
    north, east = CELL * np.mgrid[0:200, 0:400]
    plane = ElevationMap(
        elevation=0.1 * east + 0.05 * north, resolution=CELL, origin=(-20.0, -25.0)
    )
    arc = arc_on(MODEL, plane, Pose2d(3.0, -2.0, heading), curvature)
    centre = 3.0 - np.sin(heading) / curvature, -2.0 + np.cos(heading) / curvature
    radius = np.hypot(arc.x - centre[0], arc.y - centre[1])
    np.testing.assert_allclose(radius, 1.0 / abs(curvature))
    np.testing.assert_allclose(np.hypot(np.diff(arc.x), np.diff(arc.y)), arc.step, rtol=1e-3)
    assert (arc.x[0, 0, 0], arc.y[0, 0, 0]) == pytest.approx((3.0, -2.0))
    cos, sin = np.cos(arc.yaw), np.sin(arc.yaw)
    np.testing.assert_allclose(arc.grade, np.arctan(0.1 * cos + 0.05 * sin), atol=1e-9)
    np.testing.assert_allclose(arc.roll, np.arctan(0.05 * cos - 0.1 * sin), atol=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_stop_on_hills_is_not_shorter_than_the_checkers(seed: int) -> None:
    """The checker integrates in time, over grades of a separate computation."""
    rng = np.random.default_rng(seed)
    ground, heading = hills(seed), rng.uniform(-3.0, 3.0)
    speed = float(rng.uniform(0.8, 4.0))
    arc = arc_on(MODEL, ground, Pose2d(30.0, 30.0, heading))
    if arc.end.reason:
        pytest.skip("steeper than trained")
    along = np.linspace(0.0, 14.0, 120)
    x, y = 30.0 + along * np.cos(heading), 30.0 + along * np.sin(heading)
    plan = ExternalPlan(name="p", x=x, y=y, speed=np.full(120, speed))
    model = read_model(ATV)
    heights = ElevationMap(elevation=ground.elevation, resolution=CELL, origin=(0.0, 0.0))
    line = line_of(plan, 0.3)
    under = ground_under(heights, line, model.vehicle)
    brakes = path_force_along(model, under, line, heights.class_names)
    field = StopDynamics.along(model, line, under, brakes)
    starts = StopStarts(np.zeros(1), np.array([speed]), np.array([0.30]), 14.0)
    checked = worst_case_stops(field, starts)
    theirs, ours = float(checked.end[0]) + 0.20, stop_from(MODEL, arc, speed)
    # Stations of the checker lie along the slope, those of the guard on the map.
    assert theirs / 1.04 - 0.02 <= ours <= theirs * 1.15 + 0.15


def test_longer_held_steeper_or_faster_is_never_shorter() -> None:
    arcs = [arc_on(MODEL, slope(grade)) for grade in (0.2, 0.1, 0.0, -0.1, -0.2)]
    for distances in (
        [stop_from(MODEL, arc, 3.0) for arc in arcs],
        [stop_from(MODEL, arcs[2], v) for v in np.linspace(0.2, 4.0, 30)],
        [stop_from(MODEL, arcs[2], 2.0, held) for held in np.linspace(0.0, 1.0, 9)],
    ):
        assert np.all(np.diff(distances) > 0.0)


def test_load_of_the_trailing_axle_is_that_of_the_closed_form() -> None:
    """Trailing axle: 1 − h/L_f times force over weight, at the strongest on level ground."""
    v = MODEL.vehicle
    level = arc_on(MODEL, slope(0.0))
    share = 1.0 - v.cg_z / (v.wheelbase - v.cg_x) * (0.40 + 0.015 * 3.0)
    assert stops(MODEL, level, 3.0, load=share - 1e-3).loaded.all()
    assert not stops(MODEL, level, 3.0, load=share + 1e-3).loaded.any()
    assert not stops(MODEL, arc_on(MODEL, slope(-0.2)), 3.0, load=share - 1e-3).loaded.any()


def test_load_of_the_trailing_axle_over_a_crest_in_a_turn() -> None:
    """A crest of 4 m where the middle has 0.8 of the speed of the fastest wheel: s² v²/(g R)."""
    v, crest = MODEL.vehicle, 0.8**2 / 4.0
    level = arc_on(MODEL, slope(0.0))
    over = level._replace(share=0.8, vertical_curvature=np.full_like(level.grade, -crest))
    share = 1.0 - crest * 9.0 / G - v.cg_z / (v.wheelbase - v.cg_x) * (0.40 + 0.015 * 3.0)
    assert stops(MODEL, over, 3.0, load=share - 1e-3).loaded.all()
    assert not stops(MODEL, over, 3.0, load=share + 1e-3).loaded.any()


def test_a_bank_leaves_less_friction_for_the_brakes() -> None:
    slippery = with_brakes(friction=0.42)
    arc, speed = arc_on(slippery, slope(0.2), Pose2d(0.0, 0.0, 0.5 * np.pi)), 3.0
    left = np.sqrt((0.42 * np.cos(0.2)) ** 2 - np.sin(0.2) ** 2)
    by_hand = speed * 0.30 + speed**2 / (2.0 * G * left) + 0.20
    distance = stop_from(slippery, arc, speed)
    assert by_hand - 1e-6 <= distance <= by_hand * 1.02 + 0.01


def test_slope_that_brakes_do_not_hold_has_no_stop() -> None:
    model = with_brakes(b_b=0.1, m_b=0.0, b_m=0.0, m_m=0.0)
    assert stop_from(model, arc_on(model, slope(-0.2)), 1.0) == np.inf


@pytest.mark.parametrize("curvature", [0.0, 0.2])
def test_reverse_arc_is_that_of_the_turned_vehicle(curvature: float) -> None:
    ground = hills(3)
    pose, turned = Pose2d(30.0, 30.0, 0.7), Pose2d(30.0, 30.0, 0.7 + np.pi)
    back = arc_on(MODEL, ground, pose, curvature, forward=False)
    forth = arc_on(MODEL, ground, turned, curvature)
    for name in ("x", "y", "yaw", "grade", "roll", "vertical_curvature"):
        np.testing.assert_allclose(getattr(back, name), getattr(forth, name), atol=1e-9)
