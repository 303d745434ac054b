"""Plans of a vehicle that starts faster than service braking can bring down."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import StopErrors
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.standing import AT_SIDE, standing, stop_reason
from slopewise.planner.plan import Status
from slopewise.planner.verify.verifier import Verification


class Verified(NamedTuple):
    """A profile v² (N,) [m²/s²], findings of the verifier, and status and reason of the plan."""

    speed_sq: Floats
    verdict: Verification
    status: Status
    reason: str


def brake_hard(column: CandidateColumn, status: Status, reason: str) -> Verified:
    """Brake fully until service braking can take over; the emergency stop where that is too late.

    Args:
        column: the candidate; its fixed prefix begins too fast.
        status, reason: those of its plan without a fault; what ends its clear distance.
    """
    station, start_sq = column.track.station, float(column.fixed_prefix[0])
    speed = np.sqrt(start_sq)
    answer, _ = column.fastest_from(0, start_sq)
    reachable = answer[0]
    answer[0] = start_sq
    for k in range(len(station) - 1):
        ds = station[k + 1] - station[k]
        braking = min(column.full_braking(k, answer[k]), column.full_braking(k + 1, answer[k]))
        after = answer[k] - 2.0 * ds * max(braking, 0.0)
        if after <= answer[k + 1]:
            if answer[k + 1] == 0.0:
                column.rest_at(float(station[k] + 0.5 * answer[k] / braking), k + 1)
            break
        answer[k + 1] = after
    # Bounds of the sides, by which service braking stops in time on them, do not hold here.
    column.clear = min(column.clear, column.clear_at_side)
    verdict = column.verify(answer, decel=np.inf)
    breach = verdict.violation
    loads = max(breach.axle_load, breach.side_load, breach.wheel_load)
    if max(verdict.overrun, loads, breach.decel) > 0.0:
        return emergency_stop(column, breach.wheel_load)
    if column.bound[0] < start_sq:
        label = Limiting(int(column.label[0])).label
        allowed = f"{np.sqrt(column.bound[0]):.2f} m/s ({label})"
    else:
        allowed = f"{np.sqrt(reachable):.2f} m/s, what service braking can bring down"
    hardest = -core.motion(column.track.station, answer)[0].min()
    text = f"starts at {speed:.2f} m/s, above {allowed}: brakes at {hardest:.2f} m/s²"
    if status is Status.BLOCKED:
        text += f"; {stop_reason(column, answer, status, reason)[1]}"
    return Verified(answer, verdict, Status.DEGRADED, text)


def emergency_stop(column: CandidateColumn, unloaded: float = 0.0) -> Verified:
    """Full braking from the start, and why even that is not enough, if it is not.

    ``unloaded`` is what a wheel lacks of its minimum load where the vehicle brakes immediately [1].
    """
    station, start_sq = column.track.station, float(column.fixed_prefix[0])
    speed = np.sqrt(start_sq)
    only_start = np.zeros_like(station)
    only_start[0] = start_sq
    verdict = column.verify(only_start, decel=np.inf)
    stop = float(verdict.stop_distance[0])
    onset = speed * column.track.dead_time[0]
    braking = max(stop - column.offset - onset, 1e-6)
    speed_sq = start_sq * np.clip(1.0 - (station - onset) / braking, 0.0, 1.0)
    k = int(np.argmin(speed_sq > 0.0))
    if k > 0:
        column.rest_at(float(onset + braking), k)
        station = column.track.station
    moving = speed_sq > 0.0
    # It brakes already: the remainder of this one stop, and its least loads.
    verdict = replace(
        verdict,
        stop_distance=np.where(moving, np.maximum(stop - station, 0.0), 0.0),
        rear_load=np.where(moving, verdict.rear_load[0], verdict.rear_load),
        side_load=np.where(moving, verdict.side_load[0], verdict.side_load),
    )
    lightest = min(verdict.rear_load[0], verdict.side_load[0])
    unloaded = max(unloaded, verdict.violation.wheel_load)
    reason = _reason_for_full_braking(column, stop, lightest, unloaded)
    return Verified(speed_sq, verdict, Status.INFEASIBLE, reason)


def _blocked_by(column: CandidateColumn) -> str:
    """Cause of a clear distance that ends before the path does."""
    if column.clear == column.clear_at_side:
        return f": {AT_SIDE}"
    status, cause = standing(column)
    return f": {cause}" if status is Status.BLOCKED else ""


def _reason_for_full_braking(
    column: CandidateColumn, stop: float, lightest: float, unloaded: float
) -> str:
    speed, over = np.sqrt(float(column.fixed_prefix[0])), stop - column.clear
    if over > 0.0:
        return (
            f"even full braking from {speed:.2f} m/s takes {stop:.2f} m, "
            f"{over:.2f} m beyond the clear distance of {column.clear:.2f} m{_blocked_by(column)}"
        )
    if lightest < column.scalars.min_load:
        return (
            f"braking from {speed:.2f} m/s leaves an axle or side {lightest:.1%} of its load, "
            f"{column.scalars.min_load:.0%} is required"
        )
    if unloaded > 0.0:
        return (
            f"braking immediately from {speed:.2f} m/s leaves a wheel "
            f"{column.scalars.min_load - unloaded:.1%} of its load, "
            f"{column.scalars.min_load:.0%} is required"
        )
    if column.errors != StopErrors():
        return (
            f"full braking from {speed:.2f} m/s takes {stop:.2f} m, and with the errors of speed "
            f"and map it may pass the clear distance of {column.clear:.2f} m"
        )
    return f"starts at {speed:.2f} m/s: only immediate full braking stops in time"
