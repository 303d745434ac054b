"""Numbers of a model file that no vehicle has, and keys that contradict each other.

Every reader of model files calls this: ranges stand where the quantities are declared,
contradictions below. Values in another unit (km/h, mm, t, ms, degrees, m/s² for a share of the
weight) mostly show in one of the two, and the unit that would explain them is named.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any, NamedTuple, TypeAlias

from slopewise.models.effects import registry
from slopewise.models.errors import ParameterError
from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Braking, Limits, Terrain
from slopewise.models.quantity import (
    GRAVITY,
    STEEPEST_DRIVEN,
    describe_range,
    in_range,
    rounded,
    unit_guess,
)
from slopewise.models.steering import Steering
from slopewise.models.surface_braking import UphillBraking
from slopewise.models.vehicle import Vehicle

Table: TypeAlias = Mapping[str, Any]

_FORCE = (0.02, 1.5)
"""F_b/W on level ground: wheels that roll freely on a hard road, and tyres on dry tarmac twice."""

_SLOPE_SHARE = 1.5
"""Share of the force on level ground by which that on trained slopes may differ: noisy logs
are fitted with coefficients that reverse the force at a corner."""

_SPEED_MARGIN = 1.5
"""Of the wheels' speed, up to which limits and trained speeds may lie above it: downhill, slip."""

_THRUST = (0.01, 2.0)
"""Share of the weight that a drive pushes with; beyond, any tyre slips."""

_POWER = (0.05, 1000.0)
"""Power per mass [W/kg]: planetary rovers have 0.1, model racing cars 300."""

_DECEL_MARGIN = 3.0
"""Of the strongest braking, up to which the service deceleration may lie above it: worn brakes."""

_CLEARANCE = 6.0
"""Wheel radii up to which the underside may lie above the ground: robots that drive over rows of
plants have 3 to 5."""

_MIN_ROLLOVER = 0.1
"""Half of the track over the height of the centre of gravity; below, 6° of roll tip the vehicle."""


_KINDS: dict[str, type[Any]] = {
    "vehicle": Vehicle,
    "terrain": Terrain,
    "limits": Limits,
    "steering": Steering,
    "tracking": Tracking,
}
"""Tables whose quantities have their ranges with them."""


class _Bound(NamedTuple):
    """A key whose value other keys bound; `by` says which."""

    key: str
    unit: str
    value: float
    low: float
    high: float
    by: str


def check_plausible(tables: Table) -> None:
    """Check the tables of a model file, which have all keys that are required, of the right kind.

    Raises:
        ParameterError: names the dotted key, what was expected, and the unit that would explain it.
    """
    vehicle, braking, limits = tables["vehicle"], tables["braking"], tables["limits"]
    for name, kind in _KINDS.items():
        _check_ranges(name, tables.get(name) or {}, kind)
    for where, table in _surfaces(braking):
        _check_ranges(where, table, Braking)
        _check_ranges(f"{where}.uphill", table.get("uphill") or {}, UphillBraking)
        _check_angles(where, table)
    surfaces = dict(_surfaces(braking))
    bounds = [*_of_vehicle(vehicle), *_of_limits(vehicle, limits, surfaces["braking"])]
    track, turning = vehicle["track_width"], tables["terrain"]["slip_track"]
    by = f" with a track of {track:g} m"
    bounds.append(_Bound("terrain.slip_track", "m", turning, track, 6.0 * track, by))
    for where, table in surfaces.items():
        bounds += [*_of_speeds(where, table, vehicle), *_of_force(where, table)]
    for bound in bounds:
        _check(bound)
    for k, effect in enumerate(tables.get("effect", ())):
        for name, parameter in registry.LAWS[effect["name"]].parameters.items():
            value = effect["parameters"].get(name)
            if value is not None:
                low, high = parameter.plausible
                _check(
                    _Bound(f"effect[{k}].parameters.{name}", parameter.unit, value, low, high, "")
                )


def _surfaces(braking: Table) -> Iterator[tuple[str, Table]]:
    """The braking model on each surface, with what it has of the base."""
    yield "braking", braking
    for name, table in braking.get("terrain", {}).items():
        ranges = {"speed_range", "grade_range"} & table.keys()
        hull = {"speed_by_grade": None} if ranges else {}
        yield f"braking.terrain.{name}", {**braking, **hull, **table}


def _check_ranges(where: str, table: Table, kind: type[Any]) -> None:
    for field in fields(kind):
        value = table.get(field.name)
        if "unit" not in field.metadata or value is None:
            continue
        low, high = field.metadata["plausible"]
        if not in_range(value, field.metadata):
            expected = f"{describe_range(field.metadata)}, got {value:g}"
            guess = unit_guess(value, field.metadata["unit"], low, high)
            raise ParameterError(f"{where}.{field.name}", expected + guess)
        _check(_Bound(f"{where}.{field.name}", field.metadata["unit"], value, low, high, ""))


def _check(bound: _Bound) -> None:
    if bound.low <= bound.value <= bound.high:
        return
    what = "a force over weight of " if bound.key.endswith("b_b") else ""
    expected = f"{what}{rounded(bound.low)} … {rounded(bound.high)} [{bound.unit}]{bound.by}"
    computed = bound.unit == "1" and bound.by
    guess = "" if computed else unit_guess(bound.value, bound.unit, bound.low, bound.high)
    raise ParameterError(bound.key, f"{expected}, got {bound.value:g}{guess}")


def _check_angles(where: str, table: Table) -> None:
    """Ranges of grade and roll, and the grades of a hull."""
    hull = table.get("speed_by_grade") or ()
    angles = {name: table.get(name) or () for name in ("grade_range", "roll_range")}
    for name, values in (*angles.items(), ("speed_by_grade", [row[0] for row in hull])):
        for value in values:
            steep = STEEPEST_DRIVEN
            _check(_Bound(f"{where}.{name}", "rad", value, -steep, steep, ""))


def _of_vehicle(v: Table) -> Iterator[_Bound]:
    mass, thrust, base, track = v["mass"], v["max_drive_force"], v["wheelbase"], v["track_width"]
    radius, weight = v["wheel_radius"], v["mass"] * GRAVITY
    by = f" with a wheelbase of {base:g} m"
    yield _Bound("vehicle.track_width", "m", track, 0.3 * base, 4.0 * base, by)
    yield _Bound("vehicle.cg_x", "m", v["cg_x"], 0.02 * base, 0.98 * base, by)
    yield _Bound("vehicle.wheel_radius", "m", radius, 0.02 * base, 0.5 * base, by)
    by = f" with a track of {track:g} m and wheels of {radius:g} m"
    yield _Bound("vehicle.cg_z", "m", v["cg_z"], 0.2 * radius, 0.5 * track / _MIN_ROLLOVER, by)
    by = f" with wheels of {radius:g} m"
    for key in ("ground_clearance", "max_step", "wheel_travel", "wheel_width"):
        if v.get(key) is not None:
            high = (_CLEARANCE if key == "ground_clearance" else 2.0) * radius
            yield _Bound(f"vehicle.{key}", "m", v[key], 0.0, high, by)
    by = f" with a track of {track:g} m"
    if v.get("width") is not None:
        yield _Bound("vehicle.width", "m", v["width"], track, 3.0 * track, by)
    for key in ("front_overhang", "rear_overhang"):
        if v.get(key) is not None:
            limits = f" with a wheelbase of {base:g} m"
            yield _Bound(f"vehicle.{key}", "m", v[key], 0.0, 3.0 * base, limits)
    low, high = (share * weight for share in _THRUST)
    masses = (thrust / (_THRUST[1] * GRAVITY), thrust / (_THRUST[0] * GRAVITY))
    by = f" with a mass of {mass:g} kg{unit_guess(mass, 'kg', *masses)}"
    yield _Bound("vehicle.max_drive_force", "N", thrust, low, high, by)
    low, high = (share * mass for share in _POWER)
    by = f" with a mass of {mass:g} kg"
    yield _Bound("vehicle.max_drive_power", "W", v["max_drive_power"], low, high, by)


def _of_limits(vehicle: Table, limits: Table, braking: Table) -> Iterator[_Bound]:
    wheels = vehicle["max_wheel_speed"]
    by = f" with wheels of at most {wheels:g} m/s"
    yield _Bound("limits.speed", "m/s", limits["speed"], 0.0, _SPEED_MARGIN * wheels, by)
    force = max(_level(braking, speed) for speed in braking["speed_range"])
    by = f" with brakes of {force:.3g} of the weight"
    high = _DECEL_MARGIN * GRAVITY * force
    yield _Bound("limits.decel", "m/s²", limits["decel"], 0.0, high, by)


def _of_speeds(where: str, table: Table, vehicle: Table) -> Iterator[_Bound]:
    wheels = vehicle["max_wheel_speed"]
    by = f" with wheels of at most {wheels:g} m/s"
    hull = table.get("speed_by_grade") or ()
    fastest = {"speed_range": table["speed_range"], "speed_by_grade": [row[1] for row in hull]}
    for key, speeds in fastest.items():
        for speed in speeds:
            yield _Bound(f"{where}.{key}", "m/s", speed, 0.0, _SPEED_MARGIN * wheels, by)


def _level(table: Table, speed: float) -> float:
    """F_b/W on level ground [1]."""
    return float(table["m_b"] * speed + table["b_b"])


def _of_force(where: str, table: Table) -> Iterator[_Bound]:
    """F_b/W at the corners of what was trained; laid to the coefficient that weighs the most."""
    speeds, low = table["speed_range"], min(table["speed_range"])
    for speed in speeds:
        key = "m_b" if abs(table["m_b"] * speed) > abs(table["b_b"]) else "b_b"
        by = f" at {speed:g} m/s on level ground"
        force = _level(table, speed)
        if not _FORCE[0] <= force <= _FORCE[1]:
            yield _Bound(f"{where}.{key}", "1", force, *_FORCE, by)
    hull = table.get("speed_by_grade")
    corners = [(g, v) for g in table["grade_range"] for v in speeds]
    for grade, speed in [(g, max(v, low)) for g, v in hull] if hull else corners:
        uphill = (table.get("uphill") if grade > 0.0 else None) or {}
        slope_table = {**table, **uphill}
        slope = slope_table["m_m"] * speed + slope_table["b_m"]
        level = _level(table, speed)
        force, highest = slope * grade + level, min(_FORCE[1], (1.0 + _SLOPE_SHARE) * level)
        lowest = (1.0 - _SLOPE_SHARE) * level
        if not lowest <= force <= highest:
            key = "m_m" if abs(slope_table["m_m"] * speed) > abs(slope_table["b_m"]) else "b_m"
            by = f" as a force over weight at {speed:g} m/s and {grade:g} rad, with {key} ="
            by += f" {slope_table[key]:g} ({rounded(slope_table[key] / GRAVITY)} if that is m/s²)"
            part = f"{where}.uphill" if uphill else where
            yield _Bound(f"{part}.{key}", "1", force, lowest, highest, by)
