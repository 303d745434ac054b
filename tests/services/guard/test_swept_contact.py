"""Contact of the whole body: compared with polygons that share no code with the guard."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import slopewise
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Model
from slopewise.services.guard.decide import GuardDecision
from slopewise.services.guard.guard_map import ObstacleLayers
from slopewise.services.guard.guard_model import GuardScene
from slopewise.services.guard.stop_courses import Course, Pose2d, courses_ahead
from slopewise.services.io.model_file import read_model
from tests.services.guard.guard_fixtures import ATV, MODEL

CELL, EDGE = 0.1, 12.0
SHAPE = MODEL.vehicle.shape
MIDDLE = 0.5 * EDGE


def ground_of(heights: np.ndarray, cell: float = CELL) -> ElevationMap:
    return ElevationMap(elevation=heights, resolution=cell, origin=(0.0, 0.0))


def level() -> np.ndarray:
    return np.zeros((121, 121))


def overlaps(pose: tuple[float, float, float], x: float, y: float, half: float) -> bool:
    """Separating axes of the body's rectangle and a square of a cell."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    body = np.array(
        [(SHAPE.front, 0.6), (SHAPE.front, -0.6), (-SHAPE.rear, -0.6), (-SHAPE.rear, 0.6)]
    )
    corners = body @ np.array([(cos, sin), (-sin, cos)]) + pose[:2]
    square = np.array(
        [(x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)]
    )
    for axis in ((1.0, 0.0), (0.0, 1.0), (cos, sin), (-sin, cos)):
        body_span, cell_span = corners @ axis, square @ axis
        if body_span.max() < cell_span.min() or cell_span.max() < body_span.min():
            return False
    return True


def first_overlap(
    start: Pose2d, share: float, turn: float, axis: float, square: tuple[float, float, float]
) -> float:
    """Distance at which the body meets a square, by small steps; inf where it does not [m]."""
    x, y, yaw = (
        start.x + axis * math.cos(start.heading),
        start.y + axis * math.sin(start.heading),
        start.heading,
    )
    step = 0.01
    for k in range(500):
        if overlaps((x - axis * math.cos(yaw), y - axis * math.sin(yaw), yaw), *square):
            return k * step
        yaw += 0.5 * turn * step
        x, y = x + share * step * math.cos(yaw), y + share * step * math.sin(yaw)
        yaw += 0.5 * turn * step
    return math.inf


@pytest.mark.parametrize("drive", ["skid_steer", "ackermann"])
@pytest.mark.parametrize("share", [1.0, 0.6, 0.0])
@pytest.mark.parametrize("scenes", [25, pytest.param(400, marks=pytest.mark.nightly)])
def test_first_contact_is_not_later_than_that_of_polygons_nor_without_cause(
    scenes: int, share: float, drive: str
) -> None:
    rng = np.random.default_rng(round(10 * share))
    axis = -0.5 * MODEL.vehicle.wheelbase if drive == "ackermann" else 0.0
    model, met = MODEL._replace(turn_axis=-axis), 0
    for _ in range(scenes):
        start = Pose2d(*rng.uniform(5.0, 7.0, 2), rng.uniform(-3.0, 3.0))
        turn = float(rng.uniform(-0.6, 0.6)) if share == 1.0 else float(rng.choice([-2.0, 2.0]))
        away = rng.uniform(1.0, 3.0) if share == 1.0 else rng.uniform(0.85, 1.15)
        bearing = start.heading + rng.uniform(-1.5, 1.5)
        i = round((start.x + away * math.cos(bearing)) / CELL)
        j = round((start.y + away * math.sin(bearing)) / CELL)
        heights = level()
        heights[j, i] = 1.5
        square = CELL * i, CELL * j
        if overlaps((start.x, start.y, start.heading), *square, 1.1 * CELL):
            continue
        course = Course(share, turn, turn, turn, forward=True)
        scene = GuardScene(model, ground_of(heights), math.inf)
        courses = courses_ahead(scene, start, course, 3.0)
        reached = max(courses.end.sample - 1, 0) * courses.step if courses.end.reason else math.inf
        latest = first_overlap(start, share, turn, axis, (*square, 0.5 * CELL))
        earliest = first_overlap(start, share, turn, axis, (*square, 2.1 * CELL))
        met += latest < 3.0
        assert earliest - 2.0 * courses.step - 0.01 <= reached <= latest or latest > 3.0, (
            start,
            turn,
            square,
        )
        if math.isinf(earliest):
            assert math.isinf(reached), (start, turn, square)
    assert met > scenes / 30


@pytest.mark.parametrize("angle", [0.0, 0.4, 0.785])
@pytest.mark.parametrize("cell", [0.05, 0.1, 0.2])
def test_steps_block_wheels_from_their_height_on_and_slopes_do_not(
    angle: float, cell: float
) -> None:
    """Also steps that the map shows smeared over one cell."""
    n = round(6.0 / cell)
    north, east = cell * np.indices((n, n))
    across = east * math.cos(angle) + north * math.sin(angle) - 4.0
    slope, highest = 0.25 * across, MODEL.vehicle.shape.max_step
    for height, blocks in ((1.2 * highest, True), (0.8 * highest, False), (-1.2 * highest, True)):
        shapes = [slope + height * (across > 0.0)]
        if cell < 0.2:
            shapes.append(slope + height * np.clip(across / cell, 0.0, 1.0))
        for z in shapes:
            layers = ObstacleLayers(ground_of(z, cell), MODEL.vehicle)
            x = (4.0 - 3.0 * math.sin(angle)) / math.cos(angle)
            line = (x + np.arange(-0.3, 0.3, 0.05) - layers.origin[0]) / layers.cell
            _, hit = layers.facets(line, np.full_like(line, (3.0 - layers.origin[1]) / layers.cell))
            assert hit.any() == blocks, (height, cell, angle)


def decided(
    ground: ElevationMap,
    speed: float,
    command: tuple[float, float],
    x: float = MIDDLE,
    **more: float,
) -> GuardDecision:
    model = read_model(ATV)
    return slopewise.guard_decision(model, ground, (x, MIDDLE, 0.0), speed, command, **more)


def test_what_is_next_to_the_vehicle_can_be_left_but_not_touched() -> None:
    """3 cm ahead of it the cells of the map decide, and the vehicle creeps."""
    heights = level()
    heights[:, 80:90] = 1.5
    ground, next_to = ground_of(heights), CELL * 79.5 - 0.03 - SHAPE.front
    assert decided(ground, 0.0, (0.5, 0.0), next_to).action == "stop"
    assert decided(ground, 0.0, (0.0, 0.5), next_to).action == "stop"
    leaving = decided(ground, 0.0, (-1.0, 0.0), next_to)
    assert (leaving.action, leaving.command.speed) == ("slow", pytest.approx(-0.3))
    assert decided(ground, 0.0, (-1.0, 0.0), next_to - 0.3).action == "pass"


def test_low_obstacles_pass_below_the_body_and_stones_at_its_side_do_not() -> None:
    for height, action in ((0.8, "pass"), (1.4, "slow")):
        heights = level()
        heights[60, 60 + round((SHAPE.front + 0.6) / CELL)] = height * SHAPE.clearance
        decision = decided(ground_of(heights), 0.0, (2.0, 0.0))
        assert decision.action == action
    assert decision.where == pytest.approx((MIDDLE + SHAPE.front + 0.6, MIDDLE), abs=0.3)


def test_turn_on_the_spot_ends_before_the_corner_meets_an_obstacle_or_unknown_ground() -> None:
    corner, free = math.hypot(SHAPE.front, 0.6), math.atan2(0.6, SHAPE.front)
    for height, reason in ((1.5, "an obstacle stands"), (np.nan, "ground is unknown")):
        rates = []
        for ahead in (0.5, 1.0, 1.5):
            heights, angle = level(), free + ahead
            place = MIDDLE + (corner - 0.05) * np.array([math.sin(angle), math.cos(angle)])
            heights[tuple(np.rint(place / CELL).astype(int))] = height
            decision = decided(ground_of(heights), 0.0, (0.0, 3.0))
            rates.append(decision.command.yaw_rate)
            # Dead time and hold time at the allowed rate, and the stop of the rims.
            rim = 0.5 * decision.command.yaw_rate
            assert decision.command.yaw_rate * 0.4 + rim**2 / (2 * 9.81 * 0.415) / 0.5 < ahead
            assert reason in (decision.reason or reason) or height > 0.0
        assert rates == sorted(rates)
        assert rates[0] < 1.0 < rates[2]


def test_stop_straight_ahead_is_checked_in_a_turn() -> None:
    """A wall that the arc passes, and a base that straightens its wheels does not."""
    heights = level()
    x, y = CELL * np.arange(121) - MIDDLE, CELL * np.arange(121)[:, None] - MIDDLE
    heights[(x > 2.0) & (y < 0.3)] = 1.5
    ground = ground_of(heights)
    decision = decided(ground, 2.0, (2.0, 1.0))
    assert decision.action == "stop"
    assert decided(ground, 0.3, (0.3, 0.15)).action == "pass"


def test_arguments_that_cannot_be_used_are_named() -> None:
    model, ground = read_model(ATV), ground_of(level())
    with pytest.raises(ParameterError, match="pose"):
        slopewise.guard_decision(model, ground, (1.0, 2.0), 0.0, (1.0, 0.0))  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="age"):
        decided(ground, 0.0, (1.0, 0.0), age=-1.0)
    assert decided(ground, math.nan, (1.0, 0.0)).action == "stop"


def test_errors_of_pose_and_time_in_the_model_widen_the_body_and_lengthen_the_stop() -> None:
    model, heights = read_model(ATV), level()
    heights[60 + round(0.95 / CELL), 90] = 1.5
    ground, pose = ground_of(heights), (MIDDLE, MIDDLE, 0.0)
    exact = slopewise.guard_decision(model, ground, pose, 0.0, (3.0, 0.0))
    assert exact.action == "pass"
    for tracking in (Tracking(cross_track_std=0.15), Tracking(heading_std=0.2)):
        wide = slopewise.guard_decision(
            dataclasses.replace(model, tracking=tracking), ground, pose, 0.0, (3.0, 0.0)
        )
        assert wide.action == "slow"
    late = dataclasses.replace(model, tracking=Tracking(latency=0.3))
    decisions = [
        slopewise.guard_decision(of, ground, pose, 0.0, (3.0, 0.0), clear=3.0, age=age)
        for of, age in ((late, 0.0), (model, 0.3))
    ]
    assert decisions[0] == decisions[1] != exact


@pytest.mark.parametrize("column", [-4, -1, 0])
def test_unknown_ground_that_errors_of_the_pose_bring_near_ends_a_turn_on_the_spot(
    column: int,
) -> None:
    """A cell 0.15 m from the body, which a flank meets within 0.6 rad."""
    tracked = dataclasses.replace(read_model(ATV), tracking=Tracking(cross_track_std=0.08))
    heights = level()
    heights[60 - 8, 60 + column] = np.nan
    square = MIDDLE + CELL * column, MIDDLE - CELL * 8, 0.5 * CELL
    assert not overlaps((MIDDLE, MIDDLE, 0.0), *square)
    assert any(overlaps((MIDDLE, MIDDLE, angle), *square) for angle in np.arange(0.0, 0.6, 0.02))
    decision = slopewise.guard_decision(
        tracked, ground_of(heights), (MIDDLE, MIDDLE, 0.0), 0.0, (0.0, 0.5)
    )
    assert (decision.action, decision.brake) == ("stop", True)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(("speed", "row"), [(3.0, 9), (4.0, 9), (4.0, 10)])
def test_obstacle_where_a_heading_error_of_the_model_leads_is_a_stop(
    speed: float, row: int, side: int
) -> None:
    """A base on the measured heading passes it; one 0.1 rad off meets it before it could stop."""
    tracked = dataclasses.replace(read_model(ATV), tracking=Tracking(heading_std=0.05))
    stop = speed * (0.1 + 0.3) + speed**2 / (2.0 * 9.80665 * (0.40 + 0.015 * speed))
    heights, start = level(), (MIDDLE - 2.5, MIDDLE, 0.0)
    j, i = 60 + side * row, 60 + round((0.6 + speed**2 / 8.2 - 1.6) / CELL)
    heights[j, i] = 1.5
    square = CELL * i, CELL * j, 0.5 * CELL
    reached, exact = (
        first_overlap(Pose2d(*start[:2], of), 1.0, 0.0, 0.0, square) for of in (0.1 * side, 0.0)
    )
    assert reached < stop < exact
    decision = slopewise.guard_decision(tracked, ground_of(heights), start, speed, (speed, 0.0))
    assert decision.action == "stop"
    free = slopewise.guard_decision(read_model(ATV), ground_of(heights), start, speed, (speed, 0.0))
    assert free.action == "pass"


def test_only_obstacles_next_to_the_measured_body_make_it_creep() -> None:
    """A body turned by the heading error reaches one 3 cm ahead: a stop there, free to leave."""
    tracked = dataclasses.replace(read_model(ATV), tracking=Tracking(heading_std=0.05))
    heights = level()
    heights[64, 80] = 1.5
    pose = (CELL * 79.0 - 0.03 - SHAPE.front, MIDDLE, 0.0)
    for speed, action in ((1.0, "stop"), (-1.0, "pass")):
        decision = slopewise.guard_decision(tracked, ground_of(heights), pose, 0.0, (speed, 0.0))
        assert decision.action == action


def long_quad(tracking: Tracking | None = None) -> Model:
    """A quad whose tail ends 2 m behind the middle of the wheelbase."""
    model = read_model(ATV)
    vehicle = dataclasses.replace(model.vehicle, wheelbase=1.6, cg_x=0.9)
    vehicle = dataclasses.replace(vehicle, front_overhang=0.2, rear_overhang=1.2)
    return dataclasses.replace(model, vehicle=vehicle, tracking=tracking)


def turned(model: Model, heights: np.ndarray, rate: float, speed: float = 0.0) -> GuardDecision:
    """Decision on a turn of a vehicle that stands in the middle."""
    ground, pose = ground_of(heights), (MIDDLE, MIDDLE, 0.0)
    return slopewise.guard_decision(model, ground, pose, 0.0, (speed, rate))


def test_a_turn_meets_an_obstacle_between_the_body_and_its_errors() -> None:
    """Next to a long tail, where the outline that errors widen is beyond it from the start on.

    It may be as close as the tail: turning left moves the tail there, turning right does not.
    """
    tracking = Tracking(cross_track_std=0.08, cross_track_per_curvature=0.1, heading_std=0.035)
    model, heights = long_quad(tracking), level()
    heights[50:52, 43:46] = 1.5  # from 0.3 m of the right flank on
    held = turned(model, heights, 0.8)
    assert (held.action, held.brake) == ("stop", True), held
    assert held.where == pytest.approx((CELL * 44, CELL * 51.5), abs=0.2)
    free = turned(model, heights, -0.8)
    assert free.action == "slow", free
    assert -free.command.yaw_rate * math.hypot(2.0, 0.6) <= 0.3 + 1e-9
    assert turned(long_quad(), heights, -0.8).action == "pass"


@pytest.mark.parametrize("speed", [0.0, 0.4])
def test_the_fastest_point_of_the_body_creeps_next_to_an_obstacle(speed: float) -> None:
    """A post 3 cm in front of a long quad, which its tail leaves behind four times as fast."""
    model, heights = long_quad(), level()
    heights[60, 71] = 1.5
    command = turned(model, heights, 0.8, -speed).command
    assert command.yaw_rate > 0.0
    assert abs(command.speed) + command.yaw_rate * math.hypot(2.0, 0.6) <= 0.3 + 1e-9


def test_rims_creep_in_the_turn_of_a_command_before() -> None:
    """Straight on next to a post, while the base may still follow a turn."""
    model, heights, start = read_model(ATV), level(), (MIDDLE, MIDDLE, 0.0)
    heights[60, 66] = 1.5
    before = [(0.1, 0.6)]
    command = slopewise.guard_decision(
        model, ground_of(heights), start, 0.0, (0.7, 0.0), before=before
    ).command
    tightest = model.limits.lateral_accel / 0.7**2  # less than 0.6 rad/s at 0.1 m/s [1/m]
    assert 0.0 < 0.5 * model.vehicle.track_width * tightest * command.speed <= 0.3 + 1e-9


def test_errors_along_the_heading_lengthen_both_ends_of_a_turn_on_the_spot() -> None:
    """Posts that the corners of the measured body pass."""
    exact, late = read_model(ATV), Tracking(along_track_std=0.1)
    errs, corner = dataclasses.replace(exact, tracking=late), math.hypot(SHAPE.rear, 0.6)
    for angle in (0.25 * math.pi, 1.25 * math.pi):
        reasons = []
        for model in (exact, errs):
            heights, turn = level(), angle + 0.8
            place = MIDDLE + (corner + 0.25) * np.array([math.sin(turn), math.cos(turn)])
            heights[tuple(np.rint(place / CELL).astype(int))] = 1.5
            reasons.append(turned(model, heights, 2.0).reason)
        assert not reasons[0]
        assert "an obstacle stands" in reasons[1]
