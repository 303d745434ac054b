"""Whether a plan reaches the end of its path, and the reason if not, as text."""

from __future__ import annotations

import math

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.laws.holding import friction_holds
from slopewise.models.laws.wheel_loads import left_load_share, right_load_share
from slopewise.models.quantity import GRAVITY
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.plan import Status

AT_SIDE = "next to the path, within the band of tracking errors"

_END_DISTANCE, _MAX_END_DISTANCE = 1.0, 2.9
"""Distances from the end of its path at which a plan may rest, besides what stops keep free; and
besides their offset alone, as errors of a map may keep free what is no end any more [m]."""


def standing(column: CandidateColumn) -> tuple[Status, str]:
    """Status by the end of the clear distance, if nothing goes wrong, and its cause."""
    station = column.track.station
    length = float(station[-1])
    k = column.barrier_station
    if column.blocked is not None:
        return Status.BLOCKED, column.blocked.sentence(column.model)
    if k >= len(station) and column.clear >= length:
        return Status.OK, ""
    if k >= len(station) or (k > 0 and column.clear < station[k - 1]):
        if column.clear <= 0.0:
            return Status.BLOCKED, "no way ahead of its front is known to be free"
        free = column.clear + column.model.front
        return Status.BLOCKED, f"the ground ahead of its front is known up to {free:.2f} m only"
    return Status.BLOCKED, _reason_blocked(column, k)


def stop_reason(
    column: CandidateColumn, speed_sq: Floats, status: Status, cause: str
) -> tuple[Status, str]:
    """Status and reason of a profile: where it stops, the one number for that, and the cause.

    A plan that rests well before the end of its path is not ok, for any cause.
    """
    station = column.track.station
    moving = np.flatnonzero(speed_sq > 0.0)
    k = min(int(moving[-1]) + 1, len(station) - 1) if len(moving) else 0
    if status is Status.OK:
        short = float(station[-1] - station[k])
        # Even the slowest stop keeps its offset free, and errors of map and place.
        braking, errors = column.full_braking(k, 0.0), column.errors
        fall = GRAVITY * errors.height / braking if braking > 0.0 else 0.0
        free_ahead = column.offset + errors.along_track + fall
        # Where brakes cannot hold, say, it rests for that, however near the end.
        blocking = (column.bound[k:-1] <= 0.0) & (column.label[k:-1] != Limiting.STOPPING_PATH)
        at_end = min(free_ahead + _END_DISTANCE, column.offset + _MAX_END_DISTANCE)
        if short <= at_end and not blocking.any():
            return status, cause
        cause = Limiting(int(column.label[k])).label
        if column.at_side[k]:
            cause += f", {AT_SIDE}"
    elif status is not Status.BLOCKED:
        return status, cause
    # As many digits as the table of candidates has.
    return Status.BLOCKED, f"stops at {station[k]:.1f} m of {station[-1]:.1f} m: {cause}"


def _reason_blocked(column: CandidateColumn, k: int) -> str:
    """Cause that bars station k, with its place as one ahead: the plan stops before it."""
    station = column.track.station[k]
    there = f"ahead at {station:.2f} m" if k > 0 else "at the start"
    grade, roll = np.rad2deg(column.track.grade[k]), np.rad2deg(column.track.roll[k])
    vehicle = column.model.vehicle
    match column.barrier:
        case Limiting.UNKNOWN_TERRAIN if not column.known[k]:
            return f"unknown ground under the wheels {there}"
        case (
            Limiting.UNKNOWN_TERRAIN
            | Limiting.STEP
            | Limiting.CLEARANCE
            | Limiting.BODY
            | Limiting.STEERING
        ) if obstacle := column.obstacle:
            return f"{there} {obstacle.words}"
        case Limiting.MODEL_VALIDITY:
            braking = column.model.braking
            low, high = np.rad2deg(braking.grade_range)
            if not low <= grade <= high:
                return _untrained("grade", grade, there, low, high)
            return _untrained("roll", roll, there, *np.rad2deg(braking.trained_roll))
        case Limiting.TIP_OVER:
            return f"an axle keeps too little load on grade {grade:.1f}° {there}"
        case Limiting.ROLLOVER:
            what = "a side" if _side_is_light(column, k) else "a wheel"
            return f"{what} keeps too little load on roll {roll:.1f}° {there}"
        case Limiting.FRICTION:
            mu = column.track.friction[k]
            return (
                f"grade {grade:.1f}° and roll {roll:.1f}° {there} take more than the "
                f"friction of {mu:.2f} gives"
            )
        case Limiting.HOLDING if (
            friction_holds(column.track.friction[k], column.track.grade[k], column.track.roll[k])
            < 0.0
        ):
            return (
                f"friction does not hold a standing vehicle on grade {grade:.1f}° and roll "
                f"{roll:.1f}° {there}"
            )
        case Limiting.SPEED_LIMIT:
            return f"the speed limit of the path is 0 {there}"
        case Limiting.TRACTION:
            needed = column.problem.demand[k, 0] * vehicle.mass * GRAVITY
            curvature = column.track.curvature[k]
            has = f"needs {needed:.0f} N of thrust, the drive has {vehicle.max_drive_force:.0f} N"
            if _only_turning(column, k):
                return f"the turn of radius {1.0 / abs(curvature):.2f} m {there} {has}"
            return f"grade {grade:.1f}° {there} {has}{_by_momentum(column)}"
        case _:
            return f"the brakes do not hold on grade {grade:.1f}° {there}"


def _untrained(what: str, slope: float, there: str, low: float, high: float) -> str:
    """A slope beyond a range, all in degrees, with as many digits as it takes to see it."""
    beyond = max(low - slope, slope - high, 1e-4)
    digits = max(math.ceil(-math.log10(beyond)), 1)
    return (
        f"{what} {slope:.{digits}f}° {there} is outside the trained "
        f"{low:.{digits}f}° … {high:.{digits}f}°"
    )


def _only_turning(column: CandidateColumn, k: int) -> bool:
    """Thrust is enough for the grade at station k, not for the turn on it."""
    grade, scalars = float(column.track.grade[k]), column.scalars
    straight = math.sin(grade) + scalars.resistance * math.cos(grade)
    return straight <= scalars.specific_force


def _by_momentum(column: CandidateColumn) -> str:
    """Alternatives to get over a hill that thrust alone cannot climb."""
    momentum = column.momentum
    if momentum is None:
        return ": thrust alone cannot climb it"
    last = float(column.track.station[-1])
    where = f"past {momentum.until:.2f} m" if momentum.until < last else "to the end of the path"
    speed = math.ceil(100.0 * momentum.speed) / 100.0
    limits = (
        "which no plan counts on" if momentum.allowed else "more than the limits of speed allow"
    )
    return (
        f": thrust alone cannot climb it; as far as thrust goes it takes {speed:.2f} m/s at "
        f"{momentum.station:.2f} m to get {where}, {limits}"
    )


def _side_is_light(column: CandidateColumn, k: int) -> bool:
    """At station k a whole side lacks load at rest, not only the wheel where it meets an axle."""
    vehicle, track = column.model.vehicle, column.track
    shares = (
        law(track.grade[k], track.roll[k], 0.0, vehicle.track_width, vehicle.cg_z)
        for law in (left_load_share, right_load_share)
    )
    return min(float(share) for share in shares) < column.scalars.min_load
