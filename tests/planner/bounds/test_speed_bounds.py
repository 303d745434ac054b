"""Speed bounds against the laws they are written out from, on planes, where both are exact."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

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
from slopewise.planner.bounds.speed_bounds import HOLDING
from slopewise.planner.limiting import Limiting
from tests.world.ground import plane, straight
from tests.world.stages import bounds_of
from tests.world.vehicles import G, Tables, model_of, tables_with

FAR = 80.0


def tilted(grade: float, roll: float, heading: float = 0.0) -> ElevationMap:
    """A plane on which the way along the heading has this grade and roll."""
    rise, cross = np.tan(grade), np.tan(roll) / np.cos(grade)
    cosine, sine = np.cos(heading), np.sin(heading)
    return plane(rise * cosine - cross * sine, rise * sine + cross * cosine, x=(-3.0, FAR + 3.0))


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
    # The bank takes load from the upper front wheel as well: moments about the lower wheels.
    lifting -= G * 2.0 * vehicle.cg_x / vehicle.track_width * np.cos(grade) * abs(np.sin(roll))
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
    # Moments about the outer wheels, at the highest speed of the station.
    v = model.vehicle
    level = tip_over.drive_accel_limit(grade, roll, v.cg_x, v.cg_z, model.limits.min_load)
    outward = G * np.cos(grade) * np.sin(roll) * (1.0 if curvature > 0.0 else -1.0)
    outward += abs(curvature) * speed**2 / np.cos(roll)
    assert bounds.lift[0, 0] - bounds.lift_per_speed_sq[0, 0] * speed**2 == pytest.approx(
        level - 2.0 * v.cg_x / v.track_width * outward, rel=1e-6, abs=1e-9
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


LONG = {"cg_z": 0.5, "wheelbase": 4.0, "cg_x": 2.0, "max_drive_force": 9000.0}
TALL = {"cg_z": 0.6, "track_width": 3.0, "max_drive_force": 9000.0}


def edge(label: str, along: str, end: float, second: float = 0.0, **tables: Any) -> Any:
    tables["braking"] = {"grade_range": [-1.0, 1.0], "b_m": 0.0} | tables.get("braking", {})
    if tables.get("vehicle", {}).get("track_width"):
        tables["terrain"] = {"slip_track": 3.0}
    return pytest.param(tables, label, along, end, second, id=f"{label} {along} {end}")


@pytest.mark.parametrize(
    ("tables", "label", "along", "end", "second"),
    [
        # Spare load of a side less the missing load of the axle, while the vehicle brakes.
        *(
            edge("rollover", "roll", side, g, vehicle=LONG, limits={"min_load": 0.4})
            for side in (-0.9, 0.9)
            for g in (-0.35, 0.35)
        ),
        edge(
            "tip_over",
            "grade",
            -0.6,
            vehicle=TALL,
            limits={"min_load": 0.25},
            braking={"b_b": 0.45, "b_m": -0.3},
        ),
        edge("tip_over", "grade", 0.6, vehicle=TALL | {"cg_x": 0.35}, limits={"min_load": 0.4}),
        edge("traction", "grade", 0.6, vehicle={"max_drive_force": 1500.0}),
        # Brakes have to hold at their weakest speed.
        edge("stopping_path|holding", "grade", -0.6, braking={"b_b": 0.3, "m_b": 0.05}),
        edge("stopping_path|holding", "grade", -0.6, braking={"b_b": 0.3, "m_b": -0.05}),
        # Brakes too weak to tip the vehicle: it tips standing still.
        edge(
            "tip_over|holding|stopping_path",
            "grade",
            -0.6,
            vehicle=TALL | {"cg_z": 1.1},
            braking={"b_b": 0.05, "m_b": 0.0, "m_m": 0.0},
            limits={"min_load": 0.4},
        ),
    ],
)
def test_the_steepest_slope_is_that_of_the_laws(
    tables: Tables, label: str, along: str, end: float, second: float
) -> None:
    model, start = model_of(tables_with(**tables)), 0.0

    def tilt(value: float) -> tuple[float, float]:
        return (value, second) if along == "grade" else (second, value)

    def is_blocked(value: float) -> bool:
        _, _, bounds = bounds_of(model, tilted(*tilt(value)), straight(3.0))
        if bounds.barrier_station[0] > 0:
            return False
        assert Limiting(int(bounds.barrier[0])).label in label.split("|")
        return True

    assert not is_blocked(start)
    for _ in range(30):
        middle = 0.5 * (start + end)
        start, end = (start, middle) if is_blocked(middle) else (middle, end)
    assert first_barrier(model, *tilt(start))[1] == pytest.approx(0.0, abs=1e-6)


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
