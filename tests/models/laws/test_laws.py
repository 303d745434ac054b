"""All laws alike: the same numbers in four forms, NaN or a limit outside, and sums by hand."""

from __future__ import annotations

import importlib
import inspect
import math
import pkgutil
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from slopewise.models import laws
from slopewise.models.laws import (
    braking,
    crest,
    drive,
    friction_ellipse,
    holding,
    motion_resistance,
    responsibility_sensitive_safety,
    rollover,
    slip_track,
    tip_over,
    turning_resistance,
    wheel_loads,
    wheel_lockup,
)
from tests.world.parity import check_outside, check_parity
from tests.world.vehicles import G

Range = tuple[float, float]
MODULES = [
    importlib.import_module(f"{laws.__name__}.{m.name}")
    for m in pkgutil.iter_modules(laws.__path__)
]
NOT_IN_FORMS = (tip_over.downhill_limit_under_braking,)
"""Laws of Python and numpy alone: no planner compiles them."""
LAWS: list[Callable[..., Any]] = [
    law
    for module in MODULES
    for law in vars(module).values()
    if inspect.isfunction(law) and law.__module__ == module.__name__ and law not in NOT_IN_FORMS
]

GROUPS = {
    (-40.0, 40.0): "left_thrust",
    (-4.0, 4.0): "accel_x accel_y lateral_accel",
    (-1.0, 0.5): "v_left",
    (-1.0, 1.0): "sigma",
    (-0.5, 0.5): "curvature",
    (-0.4, 0.4): "pitch",
    (-0.3, 0.3): "grade roll",
    (-0.2, -0.01): "vertical_curvature",
    (-0.2, 0.2): "side_force",
    (-0.2, 0.4): "b_b b_m m_b m_m",
    (0.0, 0.2): "along",
    (0.0, 0.5): "distance_offset time_offset",
    (0.0, 1.0): "onset_time",
    (0.0, 1.5): "share",
    (0.0, 2.0): "acceleration",
    (0.0, 6.0): "distance",
    (0.02, 0.3): "motion_resistance",
    (0.03, 0.06): "torque_constant",
    (0.05, 0.3): "min_front_share min_rear_share min_side_share resistance_ratio",
    (0.05, 0.4): "min_share",
    (0.05, 0.5): "dead_time",
    (0.1, 0.3): "wheel_radius",
    (0.1, 0.4): "lateral_resistance",
    (0.1, 0.8): "idle_current",
    (0.1, 0.9): "force_ratio",
    (0.1, 1.0): "level response_time",
    (0.1, 5.0): "onset_speed speed",
    (0.2, 0.4): "cg_z",
    (0.2, 0.8): "onset_force_ratio",
    (0.2, 1.0): "yaw_rate",
    (0.3, 0.6): "cg_x",
    (0.3, 0.8): "sliding_friction",
    (0.4, 0.9): "friction",
    (0.5, 0.9): "front_brake_share",
    (0.5, 1.0): "min_share_without_crest",
    (0.5, 1.5): "track_width",
    (0.5, 6.0): "deceleration",
    (0.6, 1.0): "normal",
    (0.6, 1.8): "slip_track",
    (0.8, 2.0): "wheelbase",
    (1.0, 2.0): "v_right",
    (1.0, 8.0): "vertical_accel",
    (1.0, 9.0): "current",
    (1.0, 16.0): "speed_sq",
    (1.5, 3.0): "stop_time",
    (10.0, 60.0): "right_thrust",
    (20.0, 60.0): "mass",
    (20.0, 90.0): "gear_ratio",
    (100.0, 200.0): "left_load right_load",
    (100.0, 300.0): "max_drive_force side_load",
    (200.0, 400.0): "weight",
    (200.0, 600.0): "max_drive_power",
}
RANGES: dict[str, Range] = {name: r for r, names in GROUPS.items() for name in names.split()}
OWN_RANGES: dict[Callable[..., Any], dict[str, Range]] = {
    crest.load_loss: {"vertical_curvature": (-0.4, 0.1)},
    crest.remaining_force: {"vertical_curvature": (-0.2, 0.05)},
    drive.powered_accel_limit: {"grade": (0.05, 0.4)},
    drive.sustained_speed: {"grade": (0.05, 0.4)},
    friction_ellipse.lateral_speed_sq: {"roll": (0.02, 0.2), "curvature": (0.02, 0.3)},
    friction_ellipse.side_force_ratio: {"curvature": (0.02, 0.3)},
    tip_over.grade_limit: {"deceleration": (-2.0, 3.0)},
    wheel_loads.front_load_share: {"deceleration": (-4.0, 4.0)},
    wheel_loads.rear_load_share: {"deceleration": (-4.0, 4.0)},
}


def ranges_of(law: Callable[..., Any]) -> dict[str, Range]:
    special = OWN_RANGES.get(law, {})
    return {name: special.get(name, RANGES[name]) for name in inspect.signature(law).parameters}


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_floats_arrays_symbols_and_machine_code_agree(law: Callable[..., Any]) -> None:
    check_parity(law, **ranges_of(law))


STOPS = (
    braking.stopping_time,
    braking.stopping_distance,
    braking.stopping_distance_as_printed,
    braking.speed_of_stopping_distance,
)
"""Brakes that do not slow stop nowhere and at no time; without any deceleration it rolls on."""


@pytest.mark.parametrize(
    ("law", "changes", "expected"),
    [
        *((law, {"deceleration": a}, np.nan) for law in STOPS for a in (-0.5, -1e-9, np.nan)),
        (braking.stopping_time, {"deceleration": 0.0}, np.inf),
        (braking.stopping_distance, {"deceleration": 0.0}, np.inf),
        (braking.speed_of_stopping_distance, {"deceleration": 0.0}, np.nan),
        (braking.speed_of_stopping_distance, {"deceleration": -0.5, "distance": 0.0}, np.nan),
        (braking.mean_deceleration, {"onset_time": 1.0, "stop_time": 1.0}, np.nan),
        (braking.mean_deceleration, {"onset_time": 1.0, "stop_time": 0.5}, np.nan),
        (friction_ellipse.braking_left, {"friction": -0.5}, np.nan),
        (friction_ellipse.lateral_speed_sq, {"friction": -0.5}, np.nan),
        (wheel_lockup.lockup_force_ratios, {"sliding_friction": -0.1}, np.nan),
        (wheel_lockup.lockup_force_ratios, {"front_brake_share": -0.1}, np.nan),
        (wheel_lockup.lockup_force_ratios, {"front_brake_share": 1.3}, np.nan),
        (wheel_lockup.friction_cap, {"sliding_friction": 0.0}, 0.0),
        (wheel_lockup.friction_cap, {"sliding_friction": -0.3}, np.nan),
        (motion_resistance.motion_resistance, {"side_load": -5.0}, np.nan),
        (wheel_loads.rear_load_share, {"cg_x": 2.2}, np.nan),
        (tip_over.grade_limit, {"cg_x": 2.2}, np.nan),
        (tip_over.rear_share_under_braking, {"cg_x": 2.2}, np.nan),
        (rollover.path_lateral_accel, {"roll": 2.0}, np.nan),
        (responsibility_sensitive_safety.rule_distance, {"deceleration": -1.0}, np.nan),
        (drive.sustained_speed, {"resistance_ratio": -0.1}, np.nan),
    ],
)
def test_outside_its_domain_a_law_has_no_value(
    law: Callable[..., Any], changes: dict[str, float], expected: float
) -> None:
    inside = {name: 0.5 * (low + high) for name, (low, high) in ranges_of(law).items()}
    check_outside(law, inside | changes, expected)


SIN = math.asin(0.6)
"""sin 0.6, cos 0.8."""
HUSKY = (147.15, 147.15, 294.3, 0.55, 0.6)
"""Slip, Table 1: side loads and weight [N], wheelbase and track width [m]; asphalt: 0.03, 0.26."""
MOTOR = (0.044, 78.71, 0.13, 147.15)
"""Slip, Table 1: torque constant, gear ratio, wheel radius, side load."""
ROVER = (30.0, 150.0, 300.0)
"""Mass, force and power of a drive: 5 m/s² below 2 m/s."""
CUBE = (1.0, 0.5, 0.5)
"""Wheelbase, and place and height of the centre of gravity."""

BY_HAND: list[tuple[Callable[..., Any], tuple[float, ...], Any]] = [
    # m = -0.02*3 - 0.1 = -0.16, b = 0.01*3 + 0.45 = 0.48
    (braking.force_ratio, (-0.2, 3.0, -0.02, -0.1, 0.01, 0.45), 0.512),
    (braking.force_ratio_at_level, (0.6, 0.1, 0.4), 0.3),
    (braking.force_ratio_at_level, (0.6, 0.1, 1.0), 0.6),
    (braking.force_ratio_at_level, (0.6, 0.1, 0.0), 0.1),
    (braking.deceleration, (0.4, math.pi / 6), 8.825985),
    (braking.deceleration, (0.4, -math.pi / 6), -0.980665),
    (braking.mean_deceleration, (3.2, 10.3, 11.3), 3.2),
    # 4 m/s at 3.2 m/s²: 1.25 s and 2.5 m of braking; as printed ½*3.2*1.55² + 1.2 + 0.5
    (braking.stopping_time, (4.0, 3.2, 0.3, 0.1), 1.65),
    (braking.stopping_distance, (4.0, 3.2, 0.3, 0.5), 4.2),
    (braking.stopping_distance, (0.0, 4.0, 0.3, 0.0), 0.0),
    (braking.stopping_distance_as_printed, (4.0, 3.2, 0.3, 0.0, 0.5), 5.544),
    (braking.stopping_distance_as_printed, (4.0, 3.2, 0.3, 0.1, 0.5), 6.056),
    # √(2*3*1.5); with a dead time of 0.5 s -1.5 + √(2.25 + 9); nothing within the offset
    (braking.speed_of_stopping_distance, (2.0, 3.0, 0.0, 0.5), 3.0),
    (braking.speed_of_stopping_distance, (2.0, 3.0, 0.5, 0.5), 1.8541019662496847),
    (braking.speed_of_stopping_distance, (0.5, 3.0, 0.0, 0.5), 0.0),
    (braking.speed_of_stopping_distance, (-1.0, 3.0, 0.0, 0.5), 0.0),
    (responsibility_sensitive_safety.rule_distance, (4.0, 0.5, 0.0, 4.0), 4.0),
    (responsibility_sensitive_safety.rule_distance, (4.0, 0.5, 2.0, 4.0), 2.25 + 25.0 / 8.0),
    # From the library of the rule's authors, PyPI ad-rss 5.0.0 (Intel),
    # calculateLongitudinalDistanceOffsetAfterStatedBrakingPattern
    (
        responsibility_sensitive_safety.rule_distance,
        (2.1885908128635383, 1.2864072317121258, 2.3149463950321807, 1.384390277532958),
        14.371665810049318,
    ),
    (
        responsibility_sensitive_safety.rule_distance,
        (0.6195426525256934, 1.2700711454878175, 0.0, 5.718746500763326),
        0.8204224448996698,
    ),
    # front 0.4*0.8 + 0.3*(0.1 + 0.6) = 0.53, rear 0.27; static 0.4 and 0.6
    (wheel_loads.front_load_share, (-SIN, 0.0, 0.1 * G, 1.0, 0.4, 0.3), 1.325),
    (wheel_loads.rear_load_share, (-SIN, 0.0, 0.1 * G, 1.0, 0.4, 0.3), 0.45),
    # transfer 0.6 - 0.1 = 0.5; left 0.8 - 0.8*0.5
    (wheel_loads.left_load_share, (0.0, SIN, -0.1 * G, 1.0, 0.4), 0.4),
    (wheel_loads.right_load_share, (0.0, SIN, -0.1 * G, 1.0, 0.4), 1.2),
    # front axle 50*0.8 + 100*0.5*0.6 = 70, rear 10; then a transfer of 5, 3/4 of it in front
    (wheel_loads.wheel_loads, (100.0, SIN, 0.0, 0.0, 0.0, 1.0, *CUBE), (35.0, 5.0, 35.0, 5.0)),
    (
        wheel_loads.wheel_loads,
        (100.0, 0.0, 0.0, 0.0, 0.1 * G, 1.0, 1.0, 0.75, 0.5),
        (33.75, 11.25, 41.25, 13.75),
    ),
    # At rest a body tips when gravity points at the front contact: a cube at 45°, 3 : 4 at 36.87°
    (tip_over.grade_limit, (0.0, *CUBE, 0.0), -math.pi / 4),
    (tip_over.grade_limit, (0.0, 1.0, 0.7, 0.4, 0.0), -SIN),
    # C = 0.25*0.4 + 0.3*0.5 = 0.25, R = 0.5: ψ - arccos(1/2)
    (tip_over.grade_limit, (0.5 * G, 1.0, 0.6, 0.3, 0.25), SIN - math.pi / 3),
    (tip_over.grade_limit, (0.8 * G, 1.0, 0.6, 0.5, 0.0), 0.0),
    (tip_over.grade_limit, (3.0 * G, *CUBE, 0.05), math.pi / 2),
    (tip_over.grade_limit, (-3.0 * G, *CUBE, 0.05), -math.pi / 2),
    (tip_over.rear_share_under_braking, (-SIN, 0.0, 0.5, 1.0, 0.4, 0.3), 0.55),
    # m = 0: cos θ = 0.1 + 0.5*0.8; no root; monotone: cos θ + 1.5 θ = 1 at 0, - 1.5 θ = 3.1 nowhere
    (tip_over.downhill_limit_under_braking, (0.0, 0.8, 1.0, 0.4, 0.3, 0.1), -math.pi / 3),
    (tip_over.downhill_limit_under_braking, (0.0, 1.2, *CUBE, 0.1), math.pi / 2),
    (tip_over.downhill_limit_under_braking, (1.0, 0.5, *CUBE, 0.1), -math.pi / 2),
    (tip_over.downhill_limit_under_braking, (-1.5, 0.9, *CUBE, 0.1), 0.0),
    (tip_over.downhill_limit_under_braking, (1.5, 3.0, *CUBE, 0.1), math.pi / 2),
    (tip_over.downhill_limit_under_braking, (-0.3, 0.4, 1.0, 1.2, 0.5, 0.1), np.nan),
    (tip_over.downhill_limit_under_braking, (np.nan, 0.4, 1.0, 0.6, 0.5, 0.1), np.nan),
    # 0.4*(0.8 - 0.05)/0.3 - 0.6 = 0.4 of g; a cube tips backwards at 45°
    (tip_over.drive_accel_limit, (SIN, 0.0, 0.4, 0.3, 0.05), 0.4 * G),
    (tip_over.drive_accel_limit, (math.pi / 4, 0.0, 0.5, 0.5, 0.0), 0.0),
    # Static stability factor T/(2H) = 1.5; left side raised to tan φ = B/(2h): -(0.75*0.8 + 0.6) g
    (rollover.lateral_accel_limits, (0.0, 0.0, 1.5, 0.5, 0.0), (-1.5 * G, 1.5 * G)),
    (rollover.lateral_accel_limits, (0.0, SIN, 0.6, 0.4, 0.0), (-1.2 * G, 0.0)),
    (rollover.path_lateral_accel, (9.0, 0.25, 0.0), 2.25),
    (rollover.path_lateral_accel, (9.0, -0.25, SIN), -2.8125),
    # Radius 4 m: all load goes at v² = 4 g; a share kept lowers it by as much
    (crest.load_loss, (2.0, -0.25), 1.0 / G),
    (crest.load_loss, (2.0, 0.25), 0.0),
    (crest.remaining_force, (2.0, -0.25, 0.5), 1.0 - 0.5 / G),
    (crest.remaining_force, (2.0, 0.25, 0.5), 1.0),
    (crest.remaining_force, (6.0, -1.0, 1.0), 0.0),
    (crest.crest_speed_sq, (0.9, 0.2, -0.25), 2.8 * G),
    (crest.crest_speed_sq, (0.1, 0.2, -0.25), 0.0),
    # 150 N below 2 m/s, then 300 W; rolling 0.1 g; (0.6 + 0.25*0.8*0.5) g
    (drive.powered_accel_limit, (0.0, 0.0, 0.0, *ROVER, 0.0), 5.0),
    (drive.powered_accel_limit, (1.0, 0.0, 0.0, *ROVER, 0.1), 5.0 - 0.980665),
    (drive.powered_accel_limit, (4.0, 0.0, 0.0, *ROVER, 0.1), 2.5 - 0.980665),
    (drive.powered_accel_limit, (1.0, SIN, math.pi / 3, *ROVER, 0.25), 5.0 - 0.7 * G),
    (drive.sustained_speed, (SIN, 30.0, 300.0, 0.25), 1.2746452662224104),
    # 15° and 0.35: of 0.338 W 0.217 W remain along the path
    (friction_ellipse.side_force_ratio, (0.0, SIN, 0.0, 0.0), 0.6),
    (friction_ellipse.normal_ratio, (0.0, 0.0, -0.25, 4.0), 1.0 - 1.0 / G),
    (friction_ellipse.normal_ratio, (0.0, 0.0, -0.25, 4.0 * G + 1.0), 0.0),
    (friction_ellipse.braking_left, (0.5, 1.0, 0.3), 0.4),
    (friction_ellipse.braking_left, (0.2, 1.0, 0.3), 0.0),
    # μ cg_z = 0.2: front 0.4/0.3, rear 0.4/0.7; at the ideal share both axles lock at μ
    (wheel_lockup.lockup_force_ratios, (0.0, 0.0, 0.5, 0.8, 1.0, 0.5, 0.25), (4 / 3, 4 / 7)),
    (wheel_lockup.lockup_force_ratios, (0.0, 0.0, 0.7, 0.8, 1.0, 0.5, 0.25), (0.8, 0.8)),
    (wheel_lockup.friction_cap, (-SIN, math.asin(0.8), 0.5), 0.24),
    (holding.brakes_hold, (0.4, math.pi / 6), -0.1),
    (holding.brakes_hold, (0.4, -SIN), -0.2),
    (holding.friction_holds, (0.5, math.atan(0.5), 0.0), 0.0),
    (holding.friction_holds, (0.5, 0.0, -math.atan(0.5)), 0.0),
    # M_r = 0.26*294.3*0.55/2; rolling 4.4145 N a side; M_r/B = 35.07075 N
    (turning_resistance.turning_moment, (0.26, 294.3, 0.55), 21.04245),
    (turning_resistance.side_thrusts, (1.0, 0.03, 0.26, *HUSKY), (39.48525, 39.48525)),
    (turning_resistance.side_thrusts, (-1.0, 0.03, 0.26, *HUSKY), (-30.65625, 39.48525)),
    (turning_resistance.lateral_resistance_on_the_spot, (39.48525, 39.48525, 0.03, *HUSKY), 0.26),
    (turning_resistance.lateral_resistance_in_a_turn, (-30.65625, 39.48525, 0.03, *HUSKY), 0.26),
    (turning_resistance.equivalent_drag_ratio, (0.5, 0.26, 0.55), 0.03575),
    # 1 A: 3.46324 N m over 19.1295 N m; idle current is no resistance
    (motion_resistance.motion_resistance, (1.0, 0.0, *MOTOR), 0.18104184636294726),
    (motion_resistance.motion_resistance, (1.8, 0.8, *MOTOR), 0.18104184636294726),
    # Slip, Table 2: beach sand 1.62 m, 45°/s on the spot; then (2 + 0.5)/2
    (slip_track.slip_track, (0.6361725123519332, -0.6361725123519332, math.pi / 4), 1.62),
    (slip_track.outer_wheel_speed_ratio, (-0.5, 1.0), 1.25),
]


@pytest.mark.parametrize(("law", "arguments", "expected"), BY_HAND)
def test_by_hand(law: Callable[..., Any], arguments: tuple[float, ...], expected: Any) -> None:
    assert law(*arguments) == pytest.approx(expected, rel=1e-9, abs=1e-12, nan_ok=True)


@pytest.mark.parametrize(("dead_time", "expected"), [(0.3, 1e-12 / 0.3), (0.0, math.sqrt(8e-12))])
def test_short_distances_lose_no_digits(dead_time: float, expected: float) -> None:
    """v = d/t_delay to first order if there is a dead time, √(2 a d) exactly without it."""
    speed = braking.speed_of_stopping_distance(1e-12, 4.0, dead_time, 0.0)
    assert speed == pytest.approx(expected, rel=1e-9, abs=0.0)
