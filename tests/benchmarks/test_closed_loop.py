"""The closed loop: its vehicle against free bodies, learned models, and whole drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.closed_loop.course import Course
from benchmarks.closed_loop.drive_loop import run_drive
from benchmarks.closed_loop.learning_drives import stops_of_drive
from benchmarks.closed_loop.loop_calibration import dead_time_of, fit, residuals
from benchmarks.closed_loop.loop_metrics import summary
from benchmarks.closed_loop.loop_terrain import slope
from benchmarks.closed_loop.moving_horizon import MovingHorizon
from benchmarks.closed_loop.policies import FixedSpeed
from benchmarks.closed_loop.quad import HIDDEN, LIMITS, OVERHANG, QUAD, ROLLING, TrueVehicle
from benchmarks.closed_loop.route import MAX_GRADE
from benchmarks.closed_loop.scenes import scene
from benchmarks.closed_loop.stop_sample import StopSample
from benchmarks.closed_loop.world import TICK, DrivenWorld
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking, Model
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from tests.benchmarks.driven_stops import G

SPIN = 4.0 * 0.6 * HIDDEN.wheel_mass / QUAD.mass
"""Turning wheels as a share of the mass."""

CALM = replace(HIDDEN, brake_scatter=0.0)
SCENES = (0, 3)
DEAD_TIME = 0.2


# ------------------------------------------------------------------------------- the vehicle


def on_slope(grade_deg: float, hidden: TrueVehicle = HIDDEN, to: float = 0.0) -> DrivenWorld:
    """Heading east on a uniform slope of firm ground, at a speed."""
    rng = np.random.default_rng(0)
    ground = slope(0.0, np.deg2rad(grade_deg), rng)
    ground = replace(ground, surface=np.zeros_like(ground.surface))
    world = DrivenWorld(ground, rng, hidden=hidden)
    world.reset(15.0, 30.0, 0.0)
    for _ in range(1500):
        if world.speed >= to:
            return world
        world.tick(2500.0, 0.0, 0.0)
    raise AssertionError(f"no faster than {world.speed:.2f} m/s")


def braking(world: DrivenWorld) -> np.ndarray:
    """Speed at every tick of an emergency stop."""
    speeds = [world.speed]
    while speeds[-1] > 0.05:
        world.tick(0.0, 1.0, 0.0)
        speeds.append(world.speed)
        assert len(speeds) < 1000, "no standstill"
    return np.array(speeds)


def steady_deceleration(speeds: np.ndarray) -> float:
    """Slope of the speed between 75 % and 25 % of its highest value."""
    top = speeds.max()
    part = np.flatnonzero((speeds < 0.75 * top) & (speeds > 0.25 * top))
    return float(-np.polyfit(TICK * part, speeds[part], 1)[0])


@pytest.mark.parametrize("grade_deg", [-18.0, 0.0, 15.0])
def test_axle_loads_at_rest_follow_the_lever(grade_deg: float) -> None:
    loads = on_slope(grade_deg).loads
    theta, weight = np.deg2rad(grade_deg), QUAD.mass * G
    lever = (QUAD.wheelbase - QUAD.cg_x) * np.cos(theta) + QUAD.cg_z * np.sin(theta)
    assert loads.sum() == pytest.approx(weight * np.cos(theta), rel=0.03)
    assert loads[2:].sum() == pytest.approx(weight * lever / QUAD.wheelbase, abs=0.03 * weight)


@pytest.mark.parametrize("grade_deg", [-12.0, 0.0, 8.0])
def test_locked_wheels_slide_by_coulomb(grade_deg: float) -> None:
    mu, theta = 0.6, np.deg2rad(grade_deg)
    locked = replace(CALM, friction=(mu, mu, mu), brake_ratio=4.0, slip=9.0, build_up=0.02)
    expected = G * (mu * np.cos(theta) + np.sin(theta))
    decel = steady_deceleration(braking(on_slope(grade_deg, locked, to=4.0)))
    assert decel == pytest.approx(expected, rel=0.04)


def test_rolling_wheels_brake_by_their_torque() -> None:
    gentle = replace(CALM, brake_ratio=0.3, build_up=0.02)
    expected = G * (gentle.brake_ratio + gentle.resistance[0]) / (1.0 + SPIN)
    decel = steady_deceleration(braking(on_slope(0.0, gentle, to=3.5)))
    assert decel == pytest.approx(expected, rel=0.04)


def test_brakes_act_after_the_dead_time_and_build_up() -> None:
    lost = -np.diff(braking(on_slope(0.0, CALM, to=3.0))).cumsum()
    late, then = round(CALM.dead_time / TICK), 0.1
    # Rolling resistance and a body that rights itself before; then a first-order build-up.
    assert lost[late - 1] < 0.12
    built = then - CALM.build_up * (1.0 - np.exp(-then / CALM.build_up))
    expected = G * (CALM.brake_ratio * built + CALM.resistance[0] * then) / (1.0 + SPIN)
    gained = lost[late - 1 + round(then / TICK)] - lost[late - 1]
    assert gained == pytest.approx(expected, rel=0.15)


def test_body_dives_under_braking() -> None:
    world = on_slope(0.0, to=3.5)
    dive = 0.0
    for _ in range(40):
        world.tick(0.0, 1.0, 0.0)
        dive = max(dive, world.pitch)
    assert np.deg2rad(0.7) < dive < np.deg2rad(4.0)


def test_wall_is_touched_by_the_front() -> None:
    world = on_slope(0.0)
    x, y, _ = world.pose
    world.wall((x + 4.0, y, 0.0))
    assert not world.collided
    for _ in range(500):
        world.tick(2000.0, 0.0, 0.0)
        if world.collided:
            break
    assert world.collided
    assert world.pose[0] - x == pytest.approx(4.0 - OVERHANG, abs=0.1)


# -------------------------------------------------------------------------- the learned model


def synthetic(count: int, scatter: float = 0.0) -> list[StopSample]:
    """Stops of F_b/W = (−0.02 v − 0.1) θ + (0.01 v + 0.45) − 0.1 |φ| after a pure dead time."""
    rng = np.random.default_rng(3)
    samples = []
    for _ in range(count):
        v, theta, phi = rng.uniform(0.8, 4.0), rng.uniform(-0.35, 0.35), rng.uniform(-0.2, 0.2)
        force = (-0.02 * v - 0.1) * theta + 0.01 * v + 0.45 - 0.1 * abs(phi)
        force *= 1.0 + scatter * rng.standard_normal()
        a = G * (force + np.sin(theta))
        ones, zero = np.ones(2), np.zeros(2)
        ends = np.array([-1.0, 15.0])
        track = GroundTrack(ends, theta * ones, phi * ones, zero, zero, zero, zero)
        distance, time = v * DEAD_TIME + v * v / (2 * a), DEAD_TIME + v / a
        samples.append(StopSample("firm", v, distance, time, track, theta))
    return samples


def test_exact_law_is_recovered() -> None:
    samples = synthetic(60)
    model = fit(samples, "synthetic")
    b = model.braking.on("firm")
    assert dead_time_of(samples) == pytest.approx(DEAD_TIME, abs=1e-9)
    assert (b.m_m, b.b_m, b.m_b, b.b_b) == pytest.approx((-0.02, -0.1, 0.01, 0.45), abs=1e-6)
    assert model.effect[0].parameters["k"] == pytest.approx(-0.1, abs=1e-6)
    assert model.effect[1].parameters["k"] == pytest.approx(0.0, abs=1e-9)
    assert b.distance_offset < 1e-3


def test_scatter_is_covered_without_excess() -> None:
    samples = synthetic(150, scatter=0.02)
    model = fit(samples, "synthetic")
    b = model.braking.on("firm")
    beyond = residuals(samples, b, *(effect.parameters["k"] for effect in model.effect))
    assert beyond.max() <= b.distance_offset + 1e-9
    assert 0.0 < b.distance_offset - beyond.mean() < 0.3
    with pytest.raises(ParameterError, match="stops on firm"):
        fit(samples[:10], "synthetic")


def test_held_out_stops_are_covered() -> None:
    learned = [s for seed in range(9) for s in stops_of_drive(seed, False, surface=0)]
    held_out = [s for seed in range(50, 52) for s in stops_of_drive(seed, False, surface=0)]
    model = fit(learned, "firm only")
    offset = model.braking.on("firm").distance_offset
    assert len(held_out) >= 4
    excess = np.array(
        [
            simulate_stop(model, s.track, s.speed, surface="firm").distance + offset - s.distance
            for s in held_out
        ]
    )
    # Some two dozen stops do not give a quantile of one in a thousand.
    assert excess.min() > -0.05
    assert excess.mean() < 0.4
    # The pitch of the body would make the ground steeper downhill.
    assert np.median([s.grade - s.body_grade for s in learned]) > np.deg2rad(0.2)


# ------------------------------------------------------------------------------------- drives


@pytest.fixture
def cautious() -> Model:
    """Weaker than the brakes are on any surface, so that no learning is needed."""
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


def test_planner_stops_before_walls_and_unknown_ground(cautious: Model) -> None:
    drives = [run_drive(*scene(n, None), MovingHorizon(cautious), n) for n in SCENES]
    figures = summary(drives, drives)
    assert figures["finished"] == len(SCENES)
    assert figures["forced_stops"] >= 3
    assert figures["collisions"] == figures["past_clear"] == 0
    assert figures["covered"] == 1.0
    assert figures["least_load"] > LIMITS.min_load
    assert figures["track_error"] < 0.4


def test_fixed_speed_hits_walls_in_the_same_world(cautious: Model) -> None:
    hits = 0
    for n in SCENES:
        terrain, route, _ = scene(n, None)
        course = Course(route, np.random.default_rng(n), only_forced=True, sight=(1.2, 2.0))
        hits += run_drive(terrain, route, course, FixedSpeed(cautious, 3.5), n).collisions
    assert hits > 0


def test_scene_is_the_same_for_every_policy() -> None:
    first, again = scene(4, None), scene(4, None)
    assert np.array_equal(first[0].height, again[0].height)
    assert np.array_equal(first[1].station, again[1].station)
    assert first[2].events == again[2].events


@pytest.mark.parametrize("number", range(6))
def test_course_never_reports_more_than_is_free(number: int) -> None:
    _, route, course = scene(number, None)
    assert np.abs(route.grade).max() <= MAX_GRADE
    stations = np.linspace(0.0, route.length, 80)
    clear = [course.reported_clear(s, foresight=False) for s in stations]
    assert np.all(np.diff(clear) >= -1e-9)
    for event in course.events:
        if event.kind == "obstacle":
            assert max(clear) <= event.barrier
        if event.kind == "forced":
            assert event.barrier <= course.sight_end(event.trigger) + 1e-9
            assert course.reported_clear(0.0, foresight=True) <= event.barrier


def test_example_controller_keeps_the_stopping_path() -> None:
    from examples.tracking_mpc import drive

    outcome = drive(0)
    assert outcome.past_clear == outcome.collisions == 0
    assert outcome.distance > 20.0
    assert outcome.mean_speed > 0.8
