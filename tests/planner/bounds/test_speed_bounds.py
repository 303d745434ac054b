"""Speed bounds against the laws they are written out from, on planes, where both are exact."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws import (
    braking,
    drive,
    rollover,
    slip_track,
    tip_over,
    turning_resistance,
    wheel_loads,
)
from slopewise.models.parameters import Model
from slopewise.planner.bounds.pointwise import HOLDING
from slopewise.planner.bounds.speed_bounds import STOP_GUARD, SpeedBounds, speed_bounds
from slopewise.planner.ground.braking_ground import BrakingGround, ground_along
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from tests.planner.scenes import G, Tables, ground_map, model_of, plane, straight, tables_with

FAR = 80.0
Bounded = tuple[TerrainProfile, BrakingGround, SpeedBounds]


def bounds_of(
    model: Model,
    elevation_map: ElevationMap,
    *paths: CandidatePath,
    spacing: float = 0.25,
    clear: float = np.inf,
    curvature: float | None = None,
    speed_limit: np.ndarray | None = None,
) -> Bounded:
    """Bounds along paths; a straight one may be given the curvature, grade and roll of a circle."""
    side = batch(list(paths) or [straight(20.0)], spacing)
    v = model.vehicle
    profile = terrain_profile(elevation_map, side.x, side.y, side.count, v.wheelbase, v.track_width)
    if curvature is not None:
        profile = dataclasses.replace(profile, curvature=np.full_like(profile.x, curvature))
    ground = ground_along(profile, model, elevation_map.class_names)
    clearance = np.full(side.x.shape[1], clear)
    return profile, ground, speed_bounds(profile, ground, model, clearance, speed_limit)


def tilted(grade: float, roll: float, heading: float = 0.0) -> ElevationMap:
    """A plane on which the way along the heading has this grade and roll."""
    rise, cross = np.tan(grade), np.tan(roll) / np.cos(grade)
    cosine, sine = np.cos(heading), np.sin(heading)
    return plane(rise * cosine - cross * sine, rise * sine + cross * cosine, x=(-3.0, FAR + 3.0))


# ------------------------------------------------ parity with the laws, station by station


def allowed_speed(model: Model, grade: float, roll: float, curvature: float) -> dict[str, float]:
    """Every speed bound of one station, by the functions of `models` alone."""
    vehicle, limits, terrain = model.vehicle, model.limits, model.terrain
    skid = vehicle.drive == "skid_steer"
    # A wheel keeps its share where the side keeps as much more as the lighter axle lacks.
    geometry = vehicle.wheelbase, vehicle.cg_x, vehicle.cg_z
    axle = min(
        wheel_loads.rear_load_share(grade, roll, 0.0, *geometry),
        wheel_loads.front_load_share(grade, roll, 0.0, *geometry),
    )
    lacking = np.cos(grade) * np.cos(roll) - axle
    lowest, highest = rollover.lateral_accel_limits(
        grade, roll, vehicle.track_width, vehicle.cg_z, limits.min_load + lacking
    )
    bank = G * np.cos(grade) * np.sin(roll) * np.sign(curvature)
    lateral = max(limits.lateral_accel - max(bank, 0.0), 0.1 * limits.lateral_accel)
    per_speed_sq = rollover.path_lateral_accel(1.0, curvature, roll)
    rolling = np.inf
    if curvature != 0.0:
        rolling = np.sqrt(max((highest if curvature > 0.0 else lowest) / per_speed_sq, 0.0))
    width = terrain.slip_track if skid else vehicle.track_width
    resistance = terrain.motion_resistance
    if skid:
        resistance += turning_resistance.equivalent_drag_ratio(
            curvature, terrain.lateral_resistance, vehicle.wheelbase
        )
    return {
        "speed_limit": limits.speed,
        "model_validity": model.braking.speed_range[1],
        "lateral": np.sqrt(lateral / abs(per_speed_sq)) if curvature else np.inf,
        "rollover": rolling,
        "wheel_speed": vehicle.max_wheel_speed
        / slip_track.outer_wheel_speed_ratio(curvature, width),
        "traction": drive.sustained_speed(grade, vehicle.mass, vehicle.max_drive_power, resistance),
    }


def allowed_accel(model: Model, grade: float, roll: float, curvature: float) -> float:
    vehicle, limits, terrain = model.vehicle, model.limits, model.terrain
    resistance = terrain.motion_resistance
    if vehicle.drive == "skid_steer":
        resistance += turning_resistance.equivalent_drag_ratio(
            curvature, terrain.lateral_resistance, vehicle.wheelbase
        )
    thrust = drive.powered_accel_limit(
        0.0, grade, 0.0, vehicle.mass, vehicle.max_drive_force, 1e12, resistance
    )
    lifting = tip_over.drive_accel_limit(grade, roll, vehicle.cg_x, vehicle.cg_z, limits.min_load)
    return max(min(limits.accel, thrust, lifting), 0.0)


@st.composite
def vehicles(draw: st.DrawFn) -> Tables:
    number = st.floats
    wheelbase = draw(number(0.4, 2.5))
    track = draw(number(0.4, 1.8))
    return tables_with(
        vehicle={
            "wheelbase": wheelbase,
            "track_width": track,
            "cg_x": wheelbase * draw(number(0.3, 0.7)),
            "cg_z": wheelbase * draw(number(0.15, 0.7)),
            "drive": draw(st.sampled_from(["skid_steer", "ackermann"])),
            "max_wheel_speed": draw(number(1.0, 7.0)),
            "max_drive_force": draw(number(1000.0, 5000.0)),
            "max_drive_power": draw(number(500.0, 12000.0)),
        },
        braking={"m_m": draw(number(-0.05, 0.05)), "b_m": draw(number(-0.5, 0.5))},
        terrain={
            "slip_track": track * draw(number(1.0, 2.0)),
            "lateral_resistance": draw(number(0.0, 0.6)),
            "motion_resistance": draw(number(0.01, 0.2)),
        },
        limits={
            "min_load": draw(number(0.02, 0.4)),
            "lateral_accel": draw(number(0.5, 5.0)),
            "speed": draw(number(1.0, 5.0)),
            "accel": draw(number(0.3, 4.0)),
        },
    )


@given(
    tables=vehicles(),
    grade=st.floats(-0.3, 0.3),
    roll=st.floats(-0.3, 0.3),
    curvature=st.one_of(st.just(0.0), st.floats(-1.5, 1.5)),
    heading=st.floats(-0.1, 0.1),
)
def test_every_station_keeps_to_the_lowest_of_the_laws(
    tables: Tables, grade: float, roll: float, curvature: float, heading: float
) -> None:
    assume(curvature == 0.0 or abs(curvature) > 1e-3)
    model = model_of(tables)
    profile, _, bounds = bounds_of(
        model, tilted(grade, roll, heading), straight(FAR / 2.0, heading), curvature=curvature
    )
    assume(bounds.barrier_station[0] == profile.count[0])
    expected = allowed_speed(model, grade, roll, curvature)
    speed, label = np.sqrt(bounds.speed_sq_max[0, 0]), Limiting(int(bounds.limiting[0, 0])).label
    lowest = min(expected.values())
    if label in expected and label != "rollover":
        assert expected[label] == pytest.approx(lowest, rel=1e-6)
        assert speed == pytest.approx(lowest, rel=1e-6)
    else:
        # The stop from here decides: never above the laws of the station itself.
        assert label in ("stopping_path", "tip_over", "rollover")
        assert speed <= lowest * (1.0 + 1e-9)
    # In the planner thrust is reckoned without the roll that takes load off: at most as much.
    assert bounds.accel_max[0, 0] == pytest.approx(
        allowed_accel(model, grade, roll, curvature), rel=1e-6, abs=1e-9
    )


def first_barrier(model: Model, grade: float, roll: float) -> tuple[str, float]:
    """Limit that blocks standing on a plane, by the laws alone, and distance to its threshold."""
    vehicle, lowest = model.vehicle, model.limits.min_load
    length, x, z, width = vehicle.wheelbase, vehicle.cg_x, vehicle.cg_z, vehicle.track_width
    b, slow = model.braking, model.braking.speed_range[0]
    fast = max(min(b.speed_range[1], model.limits.speed), slow)
    force = [float(braking.force_ratio(grade, v, b.m_m, b.b_m, b.m_b, b.b_b)) for v in (slow, fast)]
    shares = [
        tip_over.rear_share_under_braking(grade, roll, force[0], length, x, z),
        wheel_loads.rear_load_share(grade, roll, 0.0, length, x, z),
        wheel_loads.front_load_share(grade, roll, 0.0, length, x, z),
    ]
    sides = [
        wheel_loads.left_load_share(grade, roll, 0.0, width, z),
        wheel_loads.right_load_share(grade, roll, 0.0, width, z),
    ]
    hold = min(force) + np.sin(grade) - HOLDING
    needed = np.sin(grade) + model.terrain.motion_resistance * np.cos(grade)
    thrust = vehicle.max_drive_force / (vehicle.mass * G) - needed
    rest = force[0] - abs(np.sin(grade))
    wheel = min(shares) + min(sides) - np.cos(grade) * np.cos(roll)
    margins = [min(shares) - lowest, min(*sides, wheel) - lowest, rest, hold, thrust]
    nearest = min(abs(m) for m in (*margins, grade - b.grade_range[0], grade - b.grade_range[1]))
    nearest = min(nearest, *(abs(roll - end) for end in b.trained_roll))
    if not b.grade_range[0] <= grade <= b.grade_range[1]:
        return "model_validity", nearest
    if not b.trained_roll[0] <= roll <= b.trained_roll[1]:
        return "model_validity", nearest
    names = ("tip_over", "rollover", "holding", "stopping_path", "traction")
    for name, margin in zip(names, margins, strict=True):
        if margin < 0.0:
            return name, nearest
    return "", nearest


@given(tables=vehicles(), grade=st.floats(-0.5, 0.5), roll=st.floats(-0.5, 0.5))
def test_ground_blocks_the_path_exactly_where_the_laws_do(
    tables: Tables, grade: float, roll: float
) -> None:
    tables["braking"]["grade_range"] = [-0.45, 0.45]
    model = model_of(tables)
    expected, nearest = first_barrier(model, grade, roll)
    assume(nearest > 1e-6)
    profile, _, bounds = bounds_of(model, tilted(grade, roll), straight(5.0))
    if expected:
        assert Limiting(int(bounds.barrier[0])).label == expected
        assert bounds.barrier_station[0] == 0
        assert np.all(bounds.speed_sq_max == 0.0)
    else:
        assert bounds.barrier_station[0] == profile.count[0]


def edge_of(
    tables: Tables, label: str, along: str, start: float, end: float, second: float
) -> float:
    """Grade or roll from which this bound (or "a|b") blocks the path, by bisection."""
    model = model_of(tables)

    def is_blocked(value: float) -> bool:
        tilt = (value, second) if along == "grade" else (second, value)
        _, _, bounds = bounds_of(model, tilted(*tilt), straight(3.0))
        if bounds.barrier_station[0] > 0:
            return False
        assert Limiting(int(bounds.barrier[0])).label in label.split("|")
        return True

    assert not is_blocked(start)
    for _ in range(40):
        middle = 0.5 * (start + end)
        start, end = (start, middle) if is_blocked(middle) else (middle, end)
    return start


WIDE = {"grade_range": [-1.0, 1.0]}


@pytest.mark.parametrize("grade", [-0.35, 0.0, 0.35])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_steepest_cross_slope_is_that_of_the_lightest_wheel(grade: float, side: float) -> None:
    """Spare load of a side less the missing load of the axle, while the vehicle brakes."""
    tables = tables_with(
        braking=WIDE | {"b_b": 0.5, "b_m": 0.0},
        vehicle={"cg_z": 0.5, "wheelbase": 4.0, "cg_x": 2.0, "max_drive_force": 9000.0},
        limits={"min_load": 0.4},
    )
    roll = edge_of(tables, "rollover", "roll", 0.0, side * 0.9, grade)
    share = wheel_loads.left_load_share if side > 0.0 else wheel_loads.right_load_share
    force = float(braking.force_ratio(grade, 1.0, -0.03, 0.0, 0.015, 0.5))
    axle = min(
        tip_over.rear_share_under_braking(grade, roll, force, 4.0, 2.0, 0.5),
        wheel_loads.rear_load_share(grade, roll, 0.0, 4.0, 2.0, 0.5),
        wheel_loads.front_load_share(grade, roll, 0.0, 4.0, 2.0, 0.5),
    )
    wheel = axle + share(grade, roll, 0.0, 1.0, 0.5) - np.cos(grade) * np.cos(roll)
    assert wheel == pytest.approx(0.4, abs=1e-6)


@pytest.mark.parametrize("roll", [0.0])
def test_the_steepest_descent_is_that_of_the_rear_load_while_braking(roll: float) -> None:
    tables = tables_with(
        braking=WIDE | {"b_b": 0.45, "b_m": -0.3},
        vehicle={"cg_z": 0.6, "track_width": 3.0},
        terrain={"slip_track": 3.0},
        limits={"min_load": 0.25},
    )
    grade = edge_of(tables, "tip_over", "grade", 0.0, -0.6, roll)
    force = float(braking.force_ratio(grade, 1.0, -0.03, -0.3, 0.015, 0.45))
    share = tip_over.rear_share_under_braking(grade, roll, force, 1.2, 0.6, 0.6)
    assert share == pytest.approx(0.25, abs=1e-6)


def test_brakes_too_weak_to_tip_the_vehicle_do_not_keep_a_slope_from_doing_it() -> None:
    """On the steepest slope it tips standing still, with any brakes."""
    tables = tables_with(
        braking=WIDE | {"b_b": 0.05, "b_m": 0.0, "m_b": 0.0, "m_m": 0.0},
        vehicle={"cg_z": 1.1, "track_width": 3.0},
        terrain={"slip_track": 3.0},
        limits={"min_load": 0.4},
    )
    model = model_of(tables)
    for grade, label in ((-0.1, "holding"), (-0.29, "holding"), (-0.33, "tip_over")):
        share = wheel_loads.rear_load_share(grade, 0.0, 0.0, 1.2, 0.6, 1.1)
        assert (share < 0.4) == (label == "tip_over")
        _, _, bounds = bounds_of(model, tilted(grade, 0.0), straight(3.0))
        assert Limiting(int(bounds.barrier[0])).label == label


@pytest.mark.parametrize("roll", [0.0])
def test_the_steepest_climb_is_that_of_the_front_load(roll: float) -> None:
    tables = tables_with(
        braking=WIDE | {"b_b": 0.4, "b_m": 0.0},
        vehicle={"cg_z": 0.6, "cg_x": 0.35, "track_width": 3.0, "max_drive_force": 9000.0},
        terrain={"slip_track": 3.0},
        limits={"min_load": 0.4},
    )
    grade = edge_of(tables, "tip_over", "grade", 0.0, 0.6, roll)
    share = wheel_loads.front_load_share(grade, roll, 0.0, 1.2, 0.35, 0.6)
    assert share == pytest.approx(0.4, abs=1e-6)


def test_the_steepest_climb_of_a_weak_drive_is_that_of_its_thrust() -> None:
    tables = tables_with(braking=WIDE, vehicle={"max_drive_force": 1500.0})
    grade = edge_of(tables, "traction", "grade", 0.0, 0.6, 0.0)
    accel = drive.powered_accel_limit(0.0, grade, 0.0, 500.0, 1500.0, 1e12, 0.13)
    assert accel == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(("m_b", "speed"), [(0.05, 0.5), (-0.05, 4.0)])
def test_the_brakes_have_to_hold_at_their_weakest_speed(m_b: float, speed: float) -> None:
    tables = tables_with(
        braking=WIDE | {"b_b": 0.3, "b_m": 0.0, "m_m": 0.0, "m_b": m_b, "speed_range": [0.5, 4.0]},
        vehicle={"cg_z": 0.2},
    )
    grade = edge_of(tables, "stopping_path|holding", "grade", 0.0, -0.6, 0.0)
    force = float(braking.force_ratio(grade, speed, 0.0, 0.0, m_b, 0.3))
    assert force + np.sin(grade) == pytest.approx(HOLDING, abs=1e-6)


@pytest.mark.parametrize("roll", [-0.15, 0.0, 0.15])
@pytest.mark.parametrize("curvature", [-0.4, 0.4])
def test_turning_downhill_across_a_slope_is_slower_than_into_it(
    roll: float, curvature: float
) -> None:
    model = model_of(tables_with(limits={"lateral_accel": 20.0}, vehicle={"cg_z": 0.8}))
    turn = bounds_of(model, tilted(0.0, roll), curvature=curvature)[2].speed_sq_max[0, 0]
    level = bounds_of(model, tilted(0.0, 0.0), curvature=curvature)[2].speed_sq_max[0, 0]
    # A left turn throws the vehicle to its right: bad where the left side is up.
    if roll * curvature > 0.0:
        assert turn < level
    elif roll * curvature < 0.0:
        assert turn > level
    else:
        assert turn == level


# ------------------------------------------------------------------------------ stopping path


def stopping_bound(distance: float, grade: float, tables: Tables, surface: str = "") -> float:
    """Highest v with v t_d + v²/(2 a(v)) + s_offset = distance on a plane, by bisection."""
    b = tables["braking"] | tables["braking"].get("terrain", {}).get(surface, {})

    def needed(v: float) -> float:
        v_i = max(v, b["speed_range"][0])
        force = (b["m_m"] * v_i + b["b_m"]) * grade + b["m_b"] * v_i + b["b_b"]
        a = G * (force + np.sin(grade))
        return float(braking.stopping_distance(v, a, b["dead_time"], b.get("distance_offset", 0.0)))

    low, high = 0.0, 6.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if needed(middle) <= distance else (low, middle)
    return low


@pytest.mark.parametrize("grade", [-0.2, -0.05, 0.0, 0.1, 0.2])
@pytest.mark.parametrize("dead_time", [0.0, 0.3, 0.6])
@pytest.mark.parametrize("m_b", [-0.03, 0.0, 0.03])
def test_the_stopping_bound_on_a_plane_is_the_closed_form(
    grade: float, dead_time: float, m_b: float
) -> None:
    tables = tables_with(braking={"dead_time": dead_time, "m_b": m_b})
    profile, _, bounds = bounds_of(
        model_of(tables), plane(rise=np.tan(grade)), straight(8.0), spacing=0.02
    )
    station = profile.station[:, 0]
    clear = bounds.clear_distance[0]
    assert clear == station[-1]
    # The last stations are given up: v² between them has to stay below the bound, too.
    ahead = clear - tables["braking"]["distance_offset"] - station > 0.06
    limited = np.flatnonzero((bounds.limiting[:, 0] == Limiting.STOPPING_PATH) & ahead)
    assert len(limited) > 20
    for k in limited[::7]:
        exact = stopping_bound(clear - station[k], grade, tables)
        speed = np.sqrt(bounds.speed_sq_max[k, 0])
        assert speed <= exact
        # The guard against errors of integration, and the chords below a convex bound.
        allowed = stopping_bound(clear - station[k] - STOP_GUARD, grade, tables)
        assert speed**2 == pytest.approx(allowed**2, abs=3e-3)


def test_below_the_slowest_trained_speed_its_coefficients_hold() -> None:
    tables = tables_with(braking={"m_b": 0.10, "speed_range": [2.0, 4.0], "m_m": 0.1})
    profile, _, bounds = bounds_of(model_of(tables), plane(rise=-0.1), straight(6.0), spacing=0.02)
    speed = np.sqrt(bounds.speed_sq_max[:, 0])
    k = int(np.argmin(np.abs(speed - 0.7)))
    exact = stopping_bound(
        profile.station[-1, 0] - STOP_GUARD - profile.station[k, 0], np.arctan(-0.1), tables
    )
    assert speed[k] == pytest.approx(exact, abs=2e-3)
    # Were the coefficients those of 0.7 m/s, this bound would not be kept.
    tables["braking"]["speed_range"][0] = 0.0
    second = stopping_bound(
        profile.station[-1, 0] - STOP_GUARD - profile.station[k, 0], np.arctan(-0.1), tables
    )
    assert exact - second > 0.03


@pytest.mark.parametrize("clear", [0.0, 0.1, 1.0, 2.77])
def test_the_way_known_free_ends_the_stopping_path(clear: float) -> None:
    tables = tables_with()
    profile, _, bounds = bounds_of(model_of(tables), plane(), straight(20.0), clear=clear)
    assert bounds.clear_distance[0] == clear
    exact = stopping_bound(clear - STOP_GUARD, 0.0, tables)
    if exact > 0.0:
        assert np.sqrt(bounds.speed_sq_max[0, 0]) == pytest.approx(exact, abs=0.03)
    beyond = profile.station[:, 0] > clear
    assert np.all(bounds.speed_sq_max[beyond, 0] == 0.0)
    assert Limiting(int(bounds.barrier[0])) is Limiting.STOPPING_PATH


def test_a_clear_distance_beyond_the_path_is_its_end() -> None:
    model = model_of(tables_with())
    profile, _, far = bounds_of(model, plane(), straight(20.0), clear=1e6)
    _, _, free = bounds_of(model, plane(), straight(20.0))
    assert far.clear_distance[0] == profile.station[-1, 0]
    np.testing.assert_array_equal(far.speed_sq_max, free.speed_sq_max)


def test_the_dead_time_of_the_surface_of_the_command_counts() -> None:
    tables = tables_with()
    tables["braking"]["terrain"] = {"slick": {"dead_time": 1.0}}
    slick = plane(classes=lambda x, y: x < 2.0, class_names=("", "slick"))
    profile, _, bounds = bounds_of(model_of(tables), slick, straight(6.0), spacing=0.1)
    station, speed = profile.station[:, 0], np.sqrt(bounds.speed_sq_max[:, 0])
    for s, surface in ((1.0, "slick"), (4.0, "")):
        k = int(np.argmin(np.abs(station - s)))
        exact = stopping_bound(station[-1] - station[k] - STOP_GUARD, 0.0, tables, surface)
        assert speed[k] == pytest.approx(exact, abs=0.01)


def test_ice_ahead_is_braked_for_before_it() -> None:
    tables = tables_with()
    tables["braking"]["terrain"] = {"ice": {"b_b": 0.1, "m_b": 0.0}}
    model = model_of(tables)
    icy = plane(classes=lambda x, y: x > 10.0, class_names=("", "ice"))
    profile, _, bounds = bounds_of(model, icy, straight(13.0))
    _, _, dry = bounds_of(model, plane(), straight(13.0))
    station = profile.station[:, 0]
    before = (station > 7.5) & (station < 9.0)
    assert np.all(bounds.speed_sq_max[before] < 0.8 * dry.speed_sq_max[before])
    assert np.all(bounds.limiting[before] == Limiting.STOPPING_PATH)
    early = station < 2.0
    np.testing.assert_array_equal(bounds.speed_sq_max[early], dry.speed_sq_max[early])


# ------------------------------------------------------------------------------- path's limits


def test_limits_of_the_path_and_of_the_model_whichever_is_lower() -> None:
    model = model_of(tables_with())
    side = batch([straight(30.0)], 0.25)
    limit = np.where(side.x < 10.0, 2.0, 9.0)
    profile, _, bounds = bounds_of(model, plane(x=(-3.0, 40.0)), straight(30.0), speed_limit=limit)
    x, speed = profile.x[:, 0], np.sqrt(bounds.speed_sq_max[:, 0])
    np.testing.assert_allclose(speed[x < 9.5], 2.0)
    np.testing.assert_allclose(speed[(x > 11.0) & (x < 25.0)], 4.0)
    assert np.all(bounds.limiting[x < 25.0] == Limiting.SPEED_LIMIT)


def test_speed_zero_is_a_limit_too() -> None:
    side = batch([straight(10.0)], 0.25)
    _, _, bounds = bounds_of(
        model_of(tables_with()), plane(), straight(10.0), speed_limit=np.zeros_like(side.x)
    )
    assert np.all(bounds.speed_sq_max == 0.0)


# ------------------------------------------------------------------------------------- barriers


def test_the_clear_distance_ends_at_the_last_station_before_a_barrier() -> None:
    tables = tables_with()
    hole = plane(unknown=lambda x, y: x > 10.0)
    profile, _, bounds = bounds_of(model_of(tables), hole, straight(20.0))
    station, known = profile.station[:, 0], profile.known[:, 0]
    first = int(np.flatnonzero(~known)[0])
    assert bounds.barrier_station[0] == first
    assert bounds.clear_distance[0] == station[first - 1]
    assert Limiting(int(bounds.barrier[0])) is Limiting.UNKNOWN_TERRAIN
    assert np.all(bounds.speed_sq_max[first - 1 :, 0] == 0.0)
    assert bounds.speed_sq_max[first - 5, 0] > 0.0


def test_a_barrier_beyond_the_way_known_free_does_not_matter() -> None:
    hole = plane(unknown=lambda x, y: x > 10.0)
    _, _, bounds = bounds_of(model_of(tables_with()), hole, straight(20.0), clear=5.0)
    assert bounds.clear_distance[0] == 5.0
    assert Limiting(int(bounds.barrier[0])) is Limiting.STOPPING_PATH


def test_a_barrier_at_the_start_leaves_nothing() -> None:
    nowhere = plane(unknown=lambda x, y: x < 2.0)
    _, _, bounds = bounds_of(model_of(tables_with()), nowhere, straight(20.0))
    assert bounds.barrier_station[0] == 0
    assert bounds.clear_distance[0] == 0.0
    assert np.all(bounds.speed_sq_max == 0.0)


# ---------------------------------------------------------------------------- between stations


@pytest.mark.parametrize("spacing", [0.1, 0.5])
def test_chords_stay_below_a_convex_bound(spacing: float) -> None:
    """On a spiral the lateral bound is convex in station: v² linear must not cut through it."""

    def spiral(n: int) -> np.ndarray:
        s = np.linspace(0.0, 30.0, n)
        yaw = 0.0005 * s**3
        steps = np.diff(s)[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)[1:]
        return np.concatenate([[(0.0, 0.0)], np.cumsum(steps, axis=0)])

    tables = tables_with(limits={"lateral_accel": 0.5, "speed": 4.0})
    model = model_of(tables)
    profile, _, bounds = bounds_of(
        model,
        plane(x=(-20.0, 40.0), y=(-20.0, 40.0)),
        CandidatePath("spiral", spiral(400)),
        spacing=spacing,
    )
    kappa, v_sq = np.abs(profile.curvature[:, 0]), bounds.speed_sq_max[:, 0]
    lateral = bounds.limiting[:, 0] == Limiting.LATERAL
    assert lateral.sum() > 10
    for share in (0.25, 0.5, 0.75):
        chord = v_sq[:-1] + share * np.diff(v_sq)
        curvature = kappa[:-1] + share * np.diff(kappa)
        # A bound of higher curvature than a parabola is left to the verifier, in per milles.
        assert np.max(chord * curvature) <= 0.5 * 1.0005
    # What that costs is second order in the spacing.
    free = np.minimum(0.5 / np.maximum(kappa, 1e-9), 16.0)
    assert np.all(v_sq[lateral] >= free[lateral] * (1.0 - 3.0 * spacing**2))


def test_candidates_do_not_see_each_other() -> None:
    tables = tables_with()
    model = model_of(tables)
    wavy = ground_map(lambda x, y: 0.6 * np.sin(x / 3.0) * np.cos(y / 4.0))
    paths = [straight(4.0 + 0.2 * i, 0.01 * i - 0.3, name=str(i)) for i in range(70)]
    _, _, together = bounds_of(model, wavy, *paths)
    for j in (0, 31, 64, 69):
        profile, _, alone = bounds_of(model, wavy, paths[j])
        n = int(profile.count[0])
        for name in ("speed_sq_max", "limiting", "accel_max", "demand"):
            np.testing.assert_array_equal(
                getattr(together, name)[:n, j], getattr(alone, name)[:, 0], err_msg=name
            )
        assert together.clear_distance[j] == alone.clear_distance[0]


@given(data=st.data())
def test_everything_is_finite_and_no_speed_is_negative(data: Any) -> None:
    tables = data.draw(vehicles())
    a, b, c = (data.draw(st.floats(-0.8, 0.8)) for _ in range(3))
    wavy = ground_map(
        lambda x, y: a * np.sin(x / 2.0) + b * np.cos(y / 3.0) + c * 0.1 * x,
        unknown=lambda x, y: (x > 18.0) & (y > 0.0),
    )
    _, _, bounds = bounds_of(model_of(tables), wavy, straight(20.0), straight(7.0, 0.3))
    for name in ("speed_sq_max", "accel_max", "demand", "clear_distance"):
        assert np.isfinite(getattr(bounds, name)).all(), name
    assert np.all(bounds.speed_sq_max >= 0.0)
    assert np.all(bounds.accel_max >= 0.0)
