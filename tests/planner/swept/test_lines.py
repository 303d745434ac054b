"""Pits, drops and posts next to a line, its band, and the turn back to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import slopewise
from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import InputErrors
from slopewise.models.parameters import Steering, Tracking
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.swept.convergence import Departure, convergence
from slopewise.planner.swept.hazards import Hazards, swept_hazards
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from tests.world.ground import ground_map, straight
from tests.world.hazards import MODELS, met, met_by, rough_ground
from tests.world.stages import profile_of
from tests.world.vehicles import ATV, model_of

CELL = 0.1  # [m]


def plan_past_pit(radius: float, gap: float, tracking: Tracking | None) -> slopewise.SpeedPlan:
    """A left turn, its reference the rear axle, whose inner wheel passes a pit at a distance."""
    model = slopewise.read_model("ugv")
    steering = Steering(kind="ackermann", reference="rear_axle", max_angle=0.6)
    model = replace(model, steering=steering, tracking=tracking)
    turned = np.arange(0.0, 1.2, CELL / radius)
    straight = np.column_stack((np.arange(0.0, 10.0, CELL), np.zeros(100)))
    arc = np.column_stack((10.0 + radius * np.sin(turned), radius * (1.0 - np.cos(turned))))
    middle = radius - 0.5 * model.vehicle.track_width - gap - 1.0
    x, y = np.meshgrid(np.arange(-5.0, 28.0, CELL), np.arange(-6.0, 22.0, CELL))
    away = np.hypot(x - 10.0 - middle * np.sin(0.6), y - radius + middle * np.cos(0.6))
    ground = slopewise.ElevationMap(
        elevation=np.where(away < 1.0, -1.5, 0.0), resolution=CELL, origin=(-5.0, -6.0)
    )
    path = slopewise.CandidatePath("p", np.concatenate((straight, arc)))
    (plan,) = slopewise.plan(model, ground, [path], start_speed=0.0)
    return plan


@pytest.mark.parametrize("radius", [6.0, 8.0, 12.0])
def test_a_pit_under_the_inner_rear_wheel_alone_is_met(radius: float) -> None:
    tracking = Tracking(cross_track_std=0.05, cross_track_per_curvature=0.1, heading_std=0.02)
    assert plan_past_pit(radius, -0.1, None).status.value == "blocked"
    assert plan_past_pit(radius, 0.1, tracking).status.value == "blocked"
    assert plan_past_pit(radius, 0.5, tracking).status.value == "ok"


QUAD, STEP = model_of(ATV), 0.2


@pytest.mark.parametrize(
    ("offset", "turned", "speed"), [(0.3, 0.0, 4.0), (0.3, 0.2, 4.0), (-0.4, 0.3, 2.0)]
)
def test_a_turn_back_keeps_to_the_lateral_limit(offset: float, turned: float, speed: float) -> None:
    flat = ElevationMap(elevation=np.zeros((100, 300)), resolution=STEP, origin=(0.0, 0.0))
    paths = batch([CandidatePath("straight", np.array([[2.0, 10.0], [50.0, 10.0]]))], STEP)
    profile = terrain_profile(
        flat, paths.x, paths.y, paths.count, QUAD.vehicle, QUAD.steering_geometry
    )
    at = Departure(np.array([2]), np.array([0.5]), np.array([offset]), turned, speed, 0.0)
    back = convergence(profile, at, QUAD, 0.0)
    assert back is not None
    lookahead = max(2.0 * QUAD.vehicle.wheelbase, speed)

    def law(_: float, state: Floats) -> list[float]:
        e, slope = state
        return [slope, -2.0 / lookahead * slope - 2.0 / lookahead**2 * e]

    distance = paths.x[:, 0] - 2.5
    ahead = np.flatnonzero(distance[: len(back.speed)] > STEP + 1e-9)
    solved = solve_ivp(
        law, (0.0, 60.0), [offset, turned], t_eval=distance[ahead], rtol=1e-9, atol=1e-12
    )
    turn = np.abs([law(0.0, state)[1] for state in solved.y.T])
    assert np.all(back.speed[ahead, 0] ** 2 * turn <= 1.001 * QUAD.limits.lateral_accel)
    # Where this course is the sharpest, the speed is what it allows.
    allowed = np.sqrt(QUAD.limits.lateral_accel / turn[0])
    assert back.speed[ahead[0], 0] == pytest.approx(allowed, rel=0.02)
    assert np.isinf(back.speed[:4, 0]).all()


BAND = 0.25
"""Distance to either side [m]."""

ONLY_STEPS = (Limiting.UNKNOWN_TERRAIN, Limiting.CLEARANCE, Limiting.BODY)


def first_blocked(hazards: Hazards) -> tuple[int, str]:
    """Index of the first blocked station and its message; the count where none is."""
    code = hazards.code[:, 0]
    k = int(np.argmax(code > 0)) if code.any() else len(code)
    obstacle = hazards.obstacle(0, k) if k < len(code) else None
    return k, "" if obstacle is None else obstacle.words


@pytest.mark.parametrize("resolution", [0.1, 0.2])
def test_a_step_on_any_line_of_the_band_blocks_the_band(resolution: float) -> None:
    blocked, freely = 0, 0
    for seed in range(60):
        rng, model = np.random.default_rng(seed), MODELS[0]
        scene = rough_ground(seed, resolution, model.vehicle.wheel_radius)
        scene = replace(scene, elevation=np.nan_to_num(scene.elevation))
        start, end = np.array([[1.5, rng.uniform(2.5, 3.5)], [10.0, rng.uniform(2.5, 3.5)]])
        normal = np.array([start[1] - end[1], end[0] - start[0]])
        normal /= np.hypot(*normal)
        lines = []
        for shift in (0.0, -BAND, -0.5 * BAND, 0.5 * BAND, BAND):
            path = CandidatePath("shifted", np.array([start, end]) + shift * normal)
            profile = profile_of(model, scene, path, spacing=resolution)
            lines.append(first_blocked(swept_hazards(scene, profile, model, lifted=ONLY_STEPS)))
            if shift == 0.0:
                errors = InputErrors(cross_track=BAND)
                band = swept_hazards(scene, profile, model, errors=errors, lifted=ONLY_STEPS)
        # The outermost lines are always checked; those between within a cell of one that is.
        for k, message in (lines[0], lines[1], lines[-1]):
            if "in the air" not in message:  # four wheels together are checked on the line alone
                assert first_blocked(band)[0] <= k, (seed, message)
        blocked += first_blocked(band)[0] < lines[0][0]
        freely += not first_blocked(band)[1]
    assert blocked >= 5
    assert freely >= 5


def test_a_drop_right_behind_another_hazard_or_the_end_of_the_path_blocks_poses_before_it() -> None:
    """A front wheel has its edge under its middle at 5.15 m: it stays a radius before."""
    last, radius = 5.15 - MODELS[0].vehicle.wheel_radius, MODELS[0].vehicle.wheel_radius

    def drop(x: Floats, y: Floats) -> Floats:
        return np.where(x > 5.75, -0.4, 0.0)

    def hole(x: Floats, y: Floats) -> Floats:
        return (x > 6.0) & (np.abs(y) < 0.25)  # between the wheels: the body touches it at 5.1 m

    for unknown, length in ((hole, 9.0), (None, 9.0), (None, 5.15 - 0.4 * radius)):
        hazards = met(ground_map(drop, resolution=CELL, unknown=unknown), straight(length))
        assert hazards.bar > 0
        assert hazards.profile.station[hazards.station, 0] <= last + CELL


def test_a_tyre_narrower_than_a_cell_falls_into_a_ditch_that_it_follows() -> None:
    """On cells as wide as the tyre it may be wider than its one row of cells by as much."""
    for heading in (0.3, 0.42, 0.6):
        along = np.linspace(-4.0, 4.0, 81)[:, None] * (np.cos(heading), np.sin(heading))
        path = CandidatePath("oblique", np.array([6.0, 0.0]) + along)
        ditch = ground_map(lambda x, y: np.where(np.abs(y) < 0.1, -0.4, 0.0), resolution=0.25)
        assert met(ditch, path).bar > 0, heading


def test_a_tyre_2_cm_wider_than_a_ditch_falls_into_it() -> None:
    """A ditch of one cell that a wheel 2 cm wider follows obliquely may be wider than the wheel."""
    model = MODELS[1]
    cell = model.vehicle.shape.wheel_width - 0.02
    side = 0.5 * model.vehicle.track_width
    ditch = ground_map(lambda x, y: np.where(np.abs(y) < 0.5 * cell, -0.4, 0.0), resolution=cell)
    for heading in (0.05, 0.08, 0.12):
        along = np.linspace(-4.0, 4.0, 81)[:, None] * (np.cos(heading), np.sin(heading))
        path = CandidatePath("oblique", np.array([6.0, side]) + along)
        assert met_by(ditch, path, model).bar > 0, heading


def test_no_corner_of_a_body_is_in_the_ground_between_coarse_cells() -> None:
    model, blocked = MODELS[0], 0
    shape = model.vehicle.shape
    for y in np.linspace(0.4, 1.9, 16):
        ground = ground_map(lambda x, y: 3.0 * ((x == 10.0) & (y == 2.0)), resolution=1.0)
        path = CandidatePath("past", np.array([[2.0, y - 1.6], [18.0, y + 1.6]]))
        hazards = met(ground, path)
        body, k = hazards.profile.body, hazards.station
        blocked += k > 0
        corners = [(a, b) for a in (shape.front, -shape.rear) for b in (0.5, -0.5)]
        for a, b in corners:
            ahead = body.heading_x[:k, 0], body.heading_y[:k, 0]
            x = body.x[:k, 0] + a * ahead[0] - b * shape.width * ahead[1]
            y_corner = body.y[:k, 0] + a * ahead[1] + b * shape.width * ahead[0]
            wheels = np.maximum(1.0 - np.abs(x - 10.0), 0.0) * np.maximum(
                1.0 - np.abs(y_corner - 2.0), 0.0
            )
            level = hazards.profile.z[:k, 0]
            assert np.all(3.0 * wheels - level <= shape.clearance + 0.02), (y, a, b)
    assert blocked >= 5


@pytest.mark.parametrize("height", [0.14, 0.15])
def test_a_log_that_an_overhang_strikes_before_wheels_climb_blocks_wherever_stations_are(
    height: float,
) -> None:
    """On cells coarser than a wheel, which climbs the log that the body is too low for."""
    log = ground_map(
        lambda x, y: height * ((np.abs(x - 5.1) < 0.14) & (y > -0.05)), resolution=0.27
    )
    for start in np.linspace(-0.27, 0.0, 15):
        path = CandidatePath("log", np.array([[start, 0.0], [start + 10.0, 0.0]]))
        assert met_by(log, path, MODELS[1]).bar > 0, start


MODEL = model_of(ATV)
CORNER = np.array([[-6.0, 0.0], [0.0, 0.0], [0.0, 6.0]])
ARC = np.linspace(-6.0, 6.0, 121)
CURVE = np.stack([ARC, 20.0 - np.sqrt(400.0 - ARC**2)], axis=1)
FINE = 0.05


def ground(x: float, y: float) -> ElevationMap:
    """Level ground with a post of 0.2 m at a place [m]."""
    along = np.arange(-9.0, 9.0, FINE)
    east, north = np.meshgrid(along, along)
    post = (np.abs(east - x) < 0.1) & (np.abs(north - y) < 0.1)
    return ElevationMap(elevation=np.where(post, 1.0, 0.0), resolution=FINE, origin=(-9.0, -9.0))


FREE = ground(8.0, -8.0)


def on_corner(s: float) -> np.ndarray:
    return np.array([min(s - 6.0, 0.0), max(s - 6.0, 0.0)])


def touched_by_follower(post: ElevationMap) -> bool:
    """A rectangle in the middle of the polyline, along its chord of a wheelbase, is over a post."""
    shape, half = MODEL.vehicle.shape, 0.5 * MODEL.vehicle.wheelbase
    v, u = np.nonzero(post.elevation > 0.5)
    x, y = u * FINE - 9.0, v * FINE - 9.0
    for s in np.arange(1.0, 11.0, 0.02):
        chord, middle = on_corner(s + half) - on_corner(s - half), on_corner(s)
        ahead = chord / np.hypot(*chord)
        along = (x - middle[0]) * ahead[0] + (y - middle[1]) * ahead[1]
        across = (y - middle[1]) * ahead[0] - (x - middle[0]) * ahead[1]
        inside = (along < shape.front) & (along > -shape.rear)
        if (inside & (np.abs(across) < 0.5 * shape.width)).any():
            return True
    return False


def test_a_post_that_only_the_follower_of_a_corner_touches_blocks_its_plan_and_check() -> None:
    planner, path = CandidatePlanner(MODEL), CandidatePath("corner", CORNER)
    line = planner.plan(FREE, [path])[0]
    on_line = CandidatePath("line", np.stack([line.x, line.y], axis=1))
    reported = plan_of_columns(line.columns())
    alone = {name: v for name, v in line.columns().items() if name != "path_deviation"}
    post = ground(0.4, -0.7)
    assert touched_by_follower(post)
    blocked, driven = planner.plan(post, [path, on_line])
    assert blocked.status.value == "blocked"
    assert driven.status.value == "ok"
    assert not check_plan_on_map(reported, MODEL, post).valid
    assert check_plan_on_map(plan_of_columns(alone), MODEL, post).valid
    assert planner.plan(ground(0.8, -0.85), [path])[0].status.value == "ok"
    assert check_plan_on_map(reported, MODEL, FREE).valid


def test_paths_on_their_line_do_not_depend_on_others_next_to_them() -> None:
    planner = CandidatePlanner(MODEL)
    curve, corner = CandidatePath("curve", CURVE), CandidatePath("corner", CORNER)
    alone, together = planner.plan(FREE, [curve]), planner.plan(FREE, [curve, corner])
    for name in ("x", "y", "speed", "clear_distance", "stop_distance"):
        np.testing.assert_array_equal(getattr(alone[0], name), getattr(together[0], name))
    assert alone[0].reason == together[0].reason


def test_negative_deviations_of_a_plan_are_refused() -> None:
    plan = CandidatePlanner(MODEL).plan(FREE, [CandidatePath("corner", CORNER)])[0]
    columns = dict(plan.columns())
    columns["path_deviation"] = np.full(len(plan.x), -0.1)
    with pytest.raises(ValueError, match=r"path_deviation\[0\].*a distance >= 0"):
        plan_of_columns(columns)
