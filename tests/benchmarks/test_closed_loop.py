"""The closed loop: its vehicle against free bodies, and whole drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.closed_loop import drive_loop
from benchmarks.closed_loop.course import MAX_GRADE
from benchmarks.closed_loop.drive_loop import run_drive, scene
from benchmarks.closed_loop.loop_campaign import summary
from benchmarks.closed_loop.loop_terrain import RESOLUTION, PhysicsGround
from benchmarks.closed_loop.policies import LevelBrakes, MovingHorizon
from benchmarks.closed_loop.quad import HIDDEN, LIMITS, OVERHANG, QUAD, TrueVehicle, learned_model
from benchmarks.closed_loop.world import TICK, DrivenWorld
from tests.benchmarks.driven_stops import G

SPIN = 4.0 * 0.6 * HIDDEN.wheel_mass / QUAD.mass
"""Turning wheels as a share of the mass."""

CALM = replace(HIDDEN, brake_scatter=0.0)


def on_slope(grade_deg: float, hidden: TrueVehicle = HIDDEN, to: float = 0.0) -> DrivenWorld:
    """Heading east on a uniform slope of firm ground, at a speed."""
    east = RESOLUTION * np.arange(241)
    height = np.tile(np.tan(np.deg2rad(grade_deg)) * east, (241, 1))
    ground = PhysicsGround(height, np.zeros((241, 241), np.int64))
    world = DrivenWorld(ground, np.random.default_rng(0), hidden=hidden)
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


def test_rolling_wheels_brake_by_their_torque_after_dead_time_and_build_up() -> None:
    gentle = replace(CALM, brake_ratio=0.3, build_up=0.02)
    expected = G * (gentle.brake_ratio + gentle.resistance[0]) / (1.0 + SPIN)
    decel = steady_deceleration(braking(on_slope(0.0, gentle, to=3.5)))
    assert decel == pytest.approx(expected, rel=0.04)
    lost = -np.diff(braking(on_slope(0.0, CALM, to=3.0))).cumsum()
    late, then = round(CALM.dead_time / TICK), 0.1
    # Rolling resistance and a body that rights itself before; then a first-order build-up.
    assert lost[late - 1] < 0.12
    built = then - CALM.build_up * (1.0 - np.exp(-then / CALM.build_up))
    expected = G * (CALM.brake_ratio * built + CALM.resistance[0] * then) / (1.0 + SPIN)
    gained = lost[late - 1 + round(then / TICK)] - lost[late - 1]
    assert gained == pytest.approx(expected, rel=0.15)


def test_body_dives_and_its_front_touches_walls() -> None:
    world = on_slope(0.0, to=3.5)
    dive = 0.0
    for _ in range(40):
        world.tick(0.0, 1.0, 0.0)
        dive = max(dive, world.pitch)
    assert np.deg2rad(0.7) < dive < np.deg2rad(4.0)
    world = on_slope(0.0)
    x, y, _ = world.pose
    world.wall((x + 4.0, y, 0.0))
    for _ in range(500):
        assert not world.collided
        world.tick(2000.0, 0.0, 0.0)
        if world.collided:
            break
    assert world.pose[0] - x == pytest.approx(4.0 - OVERHANG, abs=0.1)


@pytest.mark.nightly  # by day a controller on a plan drives there, at the end of this file
def test_planner_stops_before_walls_where_a_fixed_speed_does_not() -> None:
    model = learned_model()
    drives = [run_drive(*scene(n, None), MovingHorizon(model, budget=60.0), n) for n in (0, 3)]
    figures = summary(drives, drives)
    assert figures["finished"] == 2
    assert figures["forced_stops"] >= 3
    assert figures["collisions"] == figures["past_clear"] == 0
    assert figures["covered"] == 1.0
    assert figures["least_load"] > LIMITS.min_load
    assert figures["track_error"] < 0.4
    fixed = run_drive(*scene(0, None), LevelBrakes(model, 3.5), 0)
    assert fixed.collisions > 0
    assert fixed.past_clear > 0


@pytest.mark.parametrize("number", range(6))
def test_courses_repeat_and_never_report_more_than_is_free(number: int) -> None:
    terrain, route, course = scene(number, None)
    again = scene(number, None)
    assert np.array_equal(terrain.height, again[0].height)
    assert np.array_equal(route.station, again[1].station)
    assert course.events == again[2].events
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


@pytest.mark.parametrize(
    ("seconds", "metres"), [(12.0, 8.0), pytest.param(600.0, 20.0, marks=pytest.mark.nightly)]
)
def test_example_controller_keeps_the_stopping_path(
    seconds: float, metres: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    from examples.tracking_mpc import drive

    monkeypatch.setattr(drive_loop, "_MAX_TIME", seconds)
    outcome = drive(0)
    assert outcome.past_clear == outcome.collisions == 0
    assert outcome.distance > metres
    assert outcome.mean_speed > 0.8
