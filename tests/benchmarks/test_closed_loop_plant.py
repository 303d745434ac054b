"""The physics engine's vehicle against free bodies written out here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.closed_loop.quad import HIDDEN, QUAD, TrueVehicle
from benchmarks.closed_loop.terrain import slope
from benchmarks.closed_loop.world import TICK, DrivenWorld

G = 9.80665


def on_slope(grade_deg: float, hidden: TrueVehicle = HIDDEN) -> DrivenWorld:
    """Heading east on an even slope of firm ground."""
    rng = np.random.default_rng(0)
    ground = slope(0.0, np.deg2rad(grade_deg), rng)
    ground = replace(ground, surface=np.zeros_like(ground.surface))
    world = DrivenWorld(ground, rng, hidden=hidden)
    world.reset(15.0, 30.0, 0.0)
    return world


def speed_up(world: DrivenWorld, to: float) -> None:
    for _ in range(1500):
        if world.speed >= to:
            return
        world.tick(2500.0, 0.0, 0.0)
    raise AssertionError(f"no faster than {world.speed:.2f} m/s")


def braking(world: DrivenWorld) -> np.ndarray:
    """Speed at every tick of an emergency stop."""
    speeds = [world.speed]
    while speeds[-1] > 0.05:
        world.tick(0.0, 1.0, 0.0)
        speeds.append(world.speed)
        assert len(speeds) < 1000, "it does not stop"
    return np.array(speeds)


def steady_deceleration(speeds: np.ndarray) -> float:
    """Slope of the speed between 75 % and 25 % of its highest value."""
    top = speeds.max()
    part = np.flatnonzero((speeds < 0.75 * top) & (speeds > 0.25 * top))
    return float(-np.polyfit(TICK * part, speeds[part], 1)[0])


@pytest.mark.parametrize("grade_deg", [-18.0, 0.0, 15.0])
def test_axle_loads_at_rest_follow_the_lever(grade_deg: float) -> None:
    world = on_slope(grade_deg)
    theta = np.deg2rad(grade_deg)
    weight = QUAD.mass * G
    lever = (QUAD.wheelbase - QUAD.cg_x) * np.cos(theta) + QUAD.cg_z * np.sin(theta)
    rear = weight * lever / QUAD.wheelbase
    loads = world.loads
    assert loads.sum() == pytest.approx(weight * np.cos(theta), rel=0.03)
    assert loads[2:].sum() == pytest.approx(rear, abs=0.03 * weight)


@pytest.mark.parametrize("grade_deg", [-12.0, 0.0, 8.0])
def test_locked_wheels_slide_by_coulomb(grade_deg: float) -> None:
    mu = 0.6
    locked = replace(
        HIDDEN, friction=(mu, mu, mu), brake_ratio=4.0, slip=9.0, build_up=0.02, brake_scatter=0.0
    )
    world = on_slope(grade_deg, locked)
    speed_up(world, 4.0)
    theta = np.deg2rad(grade_deg)
    expected = G * (mu * np.cos(theta) + np.sin(theta))
    assert steady_deceleration(braking(world)) == pytest.approx(expected, rel=0.04)


def test_rolling_wheels_brake_by_their_torque() -> None:
    gentle = replace(HIDDEN, brake_ratio=0.3, build_up=0.02, brake_scatter=0.0)
    world = on_slope(0.0, gentle)
    speed_up(world, 3.5)
    # The wheels' own spin has to be braked as well.
    spin = 4.0 * 0.6 * gentle.wheel_mass / QUAD.mass
    expected = G * (gentle.brake_ratio + gentle.resistance[0]) / (1.0 + spin)
    assert steady_deceleration(braking(world)) == pytest.approx(expected, rel=0.04)


def test_brakes_bite_after_the_dead_time_and_build_up() -> None:
    world = on_slope(0.0, replace(HIDDEN, brake_scatter=0.0))
    speed_up(world, 3.0)
    lost = -np.diff(braking(world)).cumsum()
    late, then = round(HIDDEN.dead_time / TICK), 0.1
    # Rolling resistance and a body that rights itself before; then a first-order build-up.
    assert lost[late - 1] < 0.12
    spin = 4.0 * 0.6 * HIDDEN.wheel_mass / QUAD.mass
    built = then - HIDDEN.build_up * (1.0 - np.exp(-then / HIDDEN.build_up))
    expected = G * (HIDDEN.brake_ratio * built + HIDDEN.resistance[0] * then) / (1.0 + spin)
    gained = lost[late - 1 + round(then / TICK)] - lost[late - 1]
    assert gained == pytest.approx(expected, rel=0.15)


def test_body_pitch_shows_the_dive() -> None:
    world = on_slope(0.0)
    speed_up(world, 3.5)
    dive = 0.0
    for _ in range(40):
        world.tick(0.0, 1.0, 0.0)
        dive = max(dive, world.pitch)
    assert np.deg2rad(0.7) < dive < np.deg2rad(4.0)


def test_a_wall_is_felt() -> None:
    world = on_slope(0.0)
    x, y, _ = world.pose
    world.wall((x + 4.0, y, 0.0))
    assert not world.collided
    for _ in range(500):
        world.tick(2000.0, 0.0, 0.0)
        if world.collided:
            break
    reached = world.pose[0] - x
    assert world.collided
    assert reached == pytest.approx(4.0 - 0.95, abs=0.1)
