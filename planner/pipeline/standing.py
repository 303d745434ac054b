"""Whether a plan reaches the end of its path, and what stops it before, in words."""

from __future__ import annotations

import math

import numpy as np

from models.arrays import Floats
from models.laws.holding import friction_holds
from models.laws.wheel_loads import left_load_share, right_load_share
from models.quantity import GRAVITY
from planner.limiting import Limiting
from planner.pipeline.candidate_column import CandidateColumn
from planner.plan import Status

_HARDLY_SHORT = 1.0
"""So far before the end of its path a plan may rest, beside what stops keep free [m]."""


def standing(column: CandidateColumn) -> tuple[Status, str]:
    """Status by what ends the clear distance, if nothing goes wrong, and the reason."""
    station = column.track.station
    length = float(station[-1])
    k = column.barrier_station
    if k >= len(station) and column.clear >= length:
        return Status.OK, ""
    where = f"stops before {column.clear:.2f} m of {length:.2f} m"
    if k >= len(station) or (k > 0 and column.clear < station[k - 1]):
        return Status.BLOCKED, f"{where}: the way is known free up to there"
    return Status.BLOCKED, f"{where}: {_why_barred(column, k)}"


def stands_early(
    column: CandidateColumn, speed_sq: Floats, status: Status, reason: str
) -> tuple[Status, str]:
    """A plan that rests well before the end of its path is not ok, whatever the cause."""
    station = column.track.station
    moving = np.flatnonzero(speed_sq > 0.0)
    k = min(int(moving[-1]) + 1, len(station) - 1) if len(moving) else 0
    short = float(station[-1] - station[k])
    if status is not Status.OK or short <= _kept_free(column, k) + _HARDLY_SHORT:
        return status, reason
    label = Limiting(int(column.label[k])).label
    return Status.BLOCKED, f"stops at {station[k]:.2f} m of {station[-1]:.2f} m: {label}"


def _kept_free(column: CandidateColumn, k: int) -> float:
    """What even the slowest stop before the end keeps free: its offset, and the map's error [m]."""
    braking = column.full_braking(k, 0.0)
    fall = GRAVITY * column.errors.height / braking if braking > 0.0 else 0.0
    return column.offset + fall


def _why_barred(column: CandidateColumn, k: int) -> str:
    station = column.track.station[k]
    grade, roll = np.rad2deg(column.track.grade[k]), np.rad2deg(column.track.roll[k])
    vehicle = column.model.vehicle
    match column.barrier:
        case Limiting.UNKNOWN_TERRAIN if not column.known[k]:
            return f"unknown ground under the wheels at {station:.2f} m"
        case Limiting.UNKNOWN_TERRAIN | Limiting.STEP | Limiting.CLEARANCE | Limiting.BODY if (
            obstacle := column.obstacle
        ):
            return f"at {station:.2f} m {obstacle.words}"
        case Limiting.MODEL_VALIDITY:
            braking = column.model.braking
            low, high = np.rad2deg(braking.grade_range)
            if not low <= grade <= high:
                return _untrained("grade", grade, station, low, high)
            return _untrained("roll", roll, station, *np.rad2deg(braking.trained_roll))
        case Limiting.TIP_OVER:
            return f"an axle keeps too little load on grade {grade:.1f}° at {station:.2f} m"
        case Limiting.ROLLOVER:
            what = "a side" if _side_is_light(column, k) else "a wheel"
            return f"{what} keeps too little load on roll {roll:.1f}° at {station:.2f} m"
        case Limiting.FRICTION:
            mu = column.track.friction[k]
            return (
                f"grade {grade:.1f}° and roll {roll:.1f}° at {station:.2f} m take more than the "
                f"friction of {mu:.2f} gives"
            )
        case Limiting.HOLDING if (
            friction_holds(column.track.friction[k], column.track.grade[k], column.track.roll[k])
            < 0.0
        ):
            return (
                f"friction does not hold a standing vehicle on grade {grade:.1f}° and roll "
                f"{roll:.1f}° at {station:.2f} m"
            )
        case Limiting.SPEED_LIMIT:
            return f"the speed limit of the path is 0 at {station:.2f} m"
        case Limiting.TRACTION:
            needed = column.demand[k] * vehicle.mass * GRAVITY
            return (
                f"grade {grade:.1f}° at {station:.2f} m needs {needed:.0f} N of thrust, "
                f"the drive has {vehicle.max_drive_force:.0f} N{_by_momentum(column)}"
            )
        case _:
            return f"the brakes do not hold on grade {grade:.1f}° at {station:.2f} m"


def _untrained(what: str, slope: float, station: float, low: float, high: float) -> str:
    """A slope beyond a range, all in degrees, with as many digits as it takes to see it."""
    beyond = max(low - slope, slope - high, 1e-4)
    digits = max(math.ceil(-math.log10(beyond)), 1)
    return (
        f"{what} {slope:.{digits}f}° at {station:.2f} m is outside the trained "
        f"{low:.{digits}f}° … {high:.{digits}f}°"
    )


def _by_momentum(column: CandidateColumn) -> str:
    """What else would get over a hill that thrust alone cannot climb."""
    found = column.momentum
    if found is None:
        return ": thrust alone cannot climb it"
    last = float(column.track.station[-1])
    where = f"past {found.until:.2f} m" if found.until < last else "to the end of the path"
    speed = math.ceil(100.0 * found.speed) / 100.0
    limits = "which no plan counts on" if found.allowed else "more than the limits of speed allow"
    return (
        f": thrust alone cannot climb it; as far as thrust goes it takes {speed:.2f} m/s at "
        f"{found.station:.2f} m to get {where}, {limits}"
    )


def _side_is_light(column: CandidateColumn, k: int) -> bool:
    """At station k a whole side lacks load at rest, not only the wheel where it meets an axle."""
    vehicle, track = column.model.vehicle, column.track
    shares = (
        law(track.grade[k], track.roll[k], 0.0, vehicle.track_width, vehicle.cg_z)
        for law in (left_load_share, right_load_share)
    )
    return min(float(share) for share in shares) < column.scalars.min_load
