"""Crests, dips, friction and holding by the laws of `models`, many hundred scenes each.

The scenes are lanes of one batch: ground of constant slope and bend, so long that no stopping path
bounds the speed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.laws import (
    braking,
    crest,
    friction_ellipse,
    holding,
    wheel_loads,
    wheel_lockup,
)
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import HOLDING, SpeedBounds, speed_bounds
from slopewise.planner.ground.braking_ground import BrakingGround, ground_along
from slopewise.planner.ground.terrain_profile import BodyRows, TerrainProfile
from slopewise.planner.limiting import Limiting
from tests.world.vehicles import G, model_of, tables_with

SCENES, STATIONS, STEP = 800, 8, 500.0
HERE = 1
"""The checked station: neither the first nor near the end."""

FREE: dict[str, Any] = {
    "vehicle": {"max_wheel_speed": 1e3, "max_drive_force": 1e6, "max_drive_power": 1e9},
    "limits": {"speed": 40.0, "lateral_accel": 1e3, "vertical_accel": 4.0},
    "braking": {
        "speed_range": [1.0, 60.0],
        "grade_range": [-0.6, 0.6],
        "m_b": 0.0,
        "m_m": 0.0,
        "dead_time": 0.0,
    },
}
"""Nothing but the ground bounds the speed."""


def sampled(seed: int, **ranges: tuple[float, float]) -> dict[str, Floats]:
    """Grade, roll and both curvatures of the scenes; those not given are 0."""
    rng = np.random.default_rng(seed)
    names = ("grade", "roll", "curvature", "vertical_curvature")
    return {
        name: rng.uniform(*ranges[name], SCENES) if name in ranges else np.zeros(SCENES)
        for name in names
    }


def profile_of(scene: dict[str, Floats]) -> TerrainProfile:
    rows = {name: np.ascontiguousarray(np.tile(v, (STATIONS, 1))) for name, v in scene.items()}
    zero = np.zeros((STATIONS, SCENES))
    # A crest of that length would leave nothing to stop with: it is one station long.
    rows["vertical_curvature"][np.arange(STATIONS) != HERE] = 0.0
    station = np.ascontiguousarray(np.tile(STEP * np.arange(STATIONS)[:, None], (1, SCENES)))
    return TerrainProfile(
        np.full(SCENES, STATIONS),
        station,
        zero,
        zero,
        station,
        zero + 1.0,
        zero,
        rows["curvature"],
        rows["grade"],
        np.sin(rows["grade"]),
        np.sin(rows["roll"]),
        rows["vertical_curvature"],
        np.ones(zero.shape, np.bool_),
        zero.astype(np.int64) + 1,
        zero.astype(np.float32),
        np.zeros((STATIONS, 2, SCENES), np.float32),
        BodyRows(station, zero, zero + 1.0, zero),
    )


def bounds_of(
    scene: dict[str, Floats], **changes: dict[str, Any]
) -> tuple[Model, BrakingGround, SpeedBounds]:
    tables = {name: FREE.get(name, {}) | changes.get(name, {}) for name in {*FREE, *changes}}
    model = model_of(tables_with(**tables))
    profile = profile_of(scene)
    ground = ground_along(profile, model)
    return model, ground, speed_bounds(profile, ground, model, np.full(SCENES, np.inf))


def limited_by(bounds: SpeedBounds, limiting: Limiting) -> np.ndarray:
    passes = bounds.barrier_station > HERE
    mine: np.ndarray = passes & (bounds.limiting[HERE] == int(limiting))
    return mine


def lightest_wheel(model: Model, scene: dict[str, Floats]) -> Floats:
    v, (grade, roll) = model.vehicle, (scene["grade"], scene["roll"])
    weight = np.ones(SCENES)
    loads = wheel_loads.wheel_loads(
        weight, -grade, roll, 0.0, 0.0, v.wheelbase, v.track_width, v.cg_x, v.cg_z
    )
    ahead = v.cg_x / v.wheelbase
    static = 0.5 * np.array([ahead, 1.0 - ahead, ahead, 1.0 - ahead])
    lowest: Floats = np.min(np.array(loads) / static[:, None], axis=0)
    return lowest


def test_crests_are_passed_as_fast_as_wheels_and_brakes_keep_enough() -> None:
    scene = sampled(1, grade=(-0.25, 0.25), roll=(-0.25, 0.25), vertical_curvature=(-1.0, -0.01))
    model, _, bounds = bounds_of(scene)
    crested = limited_by(bounds, Limiting.CREST)
    assert crested.sum() > 100
    b = model.braking
    force = braking.force_ratio(scene["grade"], 0.0, 0.0, b.b_m, 0.0, b.b_b)
    upright = np.cos(scene["grade"]) * np.cos(scene["roll"])
    wheels = crest.crest_speed_sq(
        lightest_wheel(model, scene), model.limits.min_load, scene["vertical_curvature"]
    )
    spare = 0.8 * (force + np.sin(scene["grade"]) - HOLDING) / force
    brakes = -G * upright * spare / scene["vertical_curvature"]
    expected = np.minimum(wheels, brakes)
    # Where wheels decide, the stop from there does as well: it is labelled as a load, and as slow.
    passes = bounds.barrier_station > HERE
    assert passes.sum() > 500
    assert np.all(bounds.speed_sq_max[HERE][passes] <= expected[passes] * (1.0 + 1e-9))
    np.testing.assert_allclose(bounds.speed_sq_max[HERE][crested], expected[crested], rtol=1e-9)


def test_dips_are_passed_at_the_vertical_acceleration() -> None:
    scene = sampled(2, grade=(-0.2, 0.2), vertical_curvature=(0.02, 1.0))
    model, _, bounds = bounds_of(scene)
    dips = limited_by(bounds, Limiting.CREST)
    assert dips.sum() > 500
    felt = bounds.speed_sq_max[HERE] * scene["vertical_curvature"]
    np.testing.assert_allclose(felt[dips], model.limits.vertical_accel, rtol=1e-9)
    assert np.all(felt <= model.limits.vertical_accel * (1.0 + 1e-9))


SLIPPERY = {"braking": {"sliding_friction": 0.45}}


def test_turns_on_banks_share_the_friction_with_the_brakes() -> None:
    scene = sampled(
        3,
        grade=(-0.2, 0.2),
        roll=(-0.3, 0.3),
        curvature=(-0.5, 0.5),
        vertical_curvature=(-0.05, 0.05),
    )
    limits = {"vertical_accel": 1e3, "min_load": 0.01}
    model, _, bounds = bounds_of(scene, **SLIPPERY, limits=FREE["limits"] | limits)
    mine = limited_by(bounds, Limiting.FRICTION)
    assert mine.sum() > 500
    grade, roll, curvature = scene["grade"], scene["roll"], scene["curvature"]
    upright = np.cos(grade) * np.cos(roll)
    turning = 0.5 * model.terrain.lateral_resistance * model.vehicle.wheelbase * np.abs(curvature)
    resistance = model.terrain.motion_resistance + turning
    along = np.maximum(np.abs(np.sin(grade)), np.sin(grade) + resistance * np.cos(grade)) / upright
    speed_sq = bounds.speed_sq_max[HERE]
    expected = friction_ellipse.lateral_speed_sq(
        grade, roll, curvature, scene["vertical_curvature"], 0.45, along
    )
    np.testing.assert_allclose(speed_sq[mine], expected[mine], rtol=1e-6, atol=1e-3)
    # The remainder along the path is that of the ellipse.
    falls = np.minimum(scene["vertical_curvature"], 0.0)
    normal = friction_ellipse.normal_ratio(grade, roll, falls, speed_sq)
    across = np.maximum(
        np.abs(friction_ellipse.side_force_ratio(grade, roll, curvature, speed_sq)),
        np.abs(friction_ellipse.side_force_ratio(grade, roll, curvature, 0.0 * speed_sq)),
    )
    left = friction_ellipse.braking_left(0.45, normal, across)
    ground = bounds.ground
    counted = np.maximum(
        ground.lower_intercept[HERE] + ground.lower_slope[HERE],
        ground.lower_intercept[HERE] + 60.0 * ground.lower_slope[HERE],
    )
    assert np.all(counted[mine] <= left[mine] * (1.0 + 1e-9) + 1e-9)


def test_no_axle_is_counted_on_beyond_its_lock_up() -> None:
    scene = sampled(4, grade=(-0.2, 0.2), roll=(-0.1, 0.1))
    changes = {"drive": "ackermann", "front_brake_share": 0.7}
    model, _, bounds = bounds_of(
        scene, vehicle=changes, braking={"sliding_friction": 0.5, "b_b": 0.8, "b_m": 0.0}
    )
    v, passes = model.vehicle, bounds.barrier_station > HERE
    assert passes.sum() > 500
    upright = np.cos(scene["grade"]) * np.cos(scene["roll"])
    across = np.sin(scene["roll"]) * np.cos(scene["grade"])
    left = friction_ellipse.braking_left(0.5, upright, across) / upright
    lockups = wheel_lockup.lockup_force_ratios(
        scene["grade"], scene["roll"], 0.7, left, v.wheelbase, v.cg_x, v.cg_z
    )
    counted = bounds.ground.lower_intercept[HERE]
    np.testing.assert_allclose(counted[passes], np.min(lockups, axis=0)[passes], rtol=1e-9)


def test_no_stop_ends_where_brakes_or_friction_do_not_hold() -> None:
    scene = sampled(5, grade=(-0.5, 0.5), roll=(-0.5, 0.5))
    braked = {"b_b": 0.25, "b_m": 0.0, "sliding_friction": 0.4, "roll_range": [-0.6, 0.6]}
    model, _, bounds = bounds_of(
        scene, braking=braked, vehicle={"cg_z": 0.1}, limits={"min_load": 0.01}
    )
    blocked = bounds.barrier_station == 0
    grade, roll = scene["grade"], scene["roll"]
    margin = np.minimum(holding.brakes_hold(0.25, grade), holding.friction_holds(0.4, grade, roll))
    clear_case = np.abs(margin) > 0.01
    assert (clear_case & (margin < 0.0)).sum() > 100
    assert np.all(blocked[clear_case & (margin < 0.0)])
    # Brakes that hold may slow by little, and the drive has to climb.
    resistance = model.terrain.motion_resistance
    can_climb = np.sin(grade) + resistance * np.cos(grade) < friction_ellipse.braking_left(
        0.4, np.cos(grade) * np.cos(roll), np.sin(roll) * np.cos(grade)
    )
    easy = (margin > 0.03) & can_climb
    assert easy.sum() > 100
    assert not blocked[easy].any()
    reasons = {Limiting(int(code)) for code in bounds.barrier[blocked]}
    assert {Limiting.HOLDING, Limiting.FRICTION} <= reasons
