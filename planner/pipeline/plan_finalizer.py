"""One candidate, from its time-optimal profile to its plan: smoothed, verified, explained.

Every plan is verified: one that fails is repaired, then slowed, then replaced by the emergency
stop, which its status shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.compiled_core import core
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.full_braking import Verified, brake_hard, emergency_stop
from slopewise.planner.pipeline.standing import standing, stop_reason
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.profile.problems import SmoothingProblem
from slopewise.planner.profile.smoothing import smooth
from slopewise.planner.settings import Solver
from slopewise.planner.verify.verifier import Verification

_REPAIRS = 12
"""Repairs before the whole plan is slowed [1]: 0.96^12 is 61 % of v², a larger fault is not
local."""
_REPAIR_SHARE = 0.96
"""v² kept by a repair [1]: 2 % of speed, of the order of the chord error that it repairs."""
_FIRST_SOLVER: Solver = "interior_point"


@dataclass(frozen=True, slots=True)
class Unfinished:
    """A time-optimal profile on its way to a plan.

    Attributes:
        speed_sq: (N,) v², beginning with the fixed prefix [m²/s²].
        reachable: service braking can bring down the speed at the start.
        passed: the verifier had no objection to the profile already.
        start_accel: acceleration before the last station of the fixed prefix [m/s²], None if any
            will do.
    """

    speed_sq: Floats
    reachable: bool = True
    passed: bool = False
    start_accel: float | None = None


def finish(
    column: CandidateColumn,
    name: str,
    profile: Unfinished,
    *,
    smoothed: bool = True,
    unsmoothed: str = "",
) -> SpeedPlan:
    """The plan of a candidate.

    Its first stations may be driven already: the fixed prefix holds their v², and planning
    continues from the last of them.

    Args:
        column: the candidate alone; repairs lower its bounds. name: the candidate's.
        profile: its time-optimal one.
        smoothed: False leaves the profile unchanged.
        unsmoothed: why it is not smoothed, if smoothing was requested.
    """
    profile = _within_bounds(column, profile)
    speed_sq, is_smooth = profile.speed_sq, False
    status, reason = standing(column)
    to_smooth = smoothed and bool(speed_sq.any())
    if to_smooth and profile.passed and profile.reachable:
        # What passed the verifier once is verified again only if smoothing fails.
        answer, verdict, _ = _smooth(column, speed_sq, profile.start_accel)
        if answer is not None and verdict is not None:
            return _plan(column, name, Verified(answer, verdict, status, reason), smoothed=True)
    if profile.reachable:
        speed_sq, verdict, repaired = _repair(column, speed_sq)
        if repaired:
            status, reason = Status.DEGRADED, repaired
        if speed_sq[0] < column.fixed_prefix[0]:
            # Not even slower plans pass, and a vehicle that moves cannot just stand.
            speed_sq, verdict, status, reason = emergency_stop(column)
            to_smooth = False
        # A worse fallback keeps its own label.
        if unsmoothed and speed_sq.any() and status in (Status.OK, Status.BLOCKED):
            plan = _plan(column, name, Verified(speed_sq, verdict, status, reason), smoothed=False)
            reason = "; ".join(filter(None, (unsmoothed, plan.reason)))
            return replace(plan, status=Status.DEGRADED, reason=reason)
        if to_smooth and verdict.valid:
            answer, verified, refusal = _smooth(column, speed_sq, profile.start_accel)
            if answer is not None and verified is not None:
                speed_sq, verdict, is_smooth = answer, verified, True
            else:
                status = Status.DEGRADED
                reason = f"not smoothed, so faster changes of acceleration than allowed: {refusal}"
    else:
        speed_sq, verdict, status, reason = brake_hard(column, status, reason)
    return _plan(column, name, Verified(speed_sq, verdict, status, reason), smoothed=is_smooth)


def _within_bounds(column: CandidateColumn, profile: Unfinished) -> Unfinished:
    """A profile within the bounds, which may be lower than those of the batch."""
    begin = len(column.fixed_prefix)
    if not profile.reachable or np.all(profile.speed_sq[begin:] <= column.bound[begin:]):
        return profile
    speed_sq, reachable = column.fastest()
    return Unfinished(speed_sq, reachable, start_accel=profile.start_accel)


def keep(column: CandidateColumn, name: str, speed_sq: Floats) -> SpeedPlan | None:
    """The plan that drives a given profile (N,) [m²/s²], None if the verifier objects to it."""
    verdict = column.verify(speed_sq)
    if not verdict.valid:
        return None
    return _plan(column, name, Verified(speed_sq, verdict, *standing(column)), smoothed=True)


def _plan(column: CandidateColumn, name: str, profile: Verified, *, smoothed: bool) -> SpeedPlan:
    track, speed_sq = column.track, profile.speed_sq
    status, reason = stop_reason(column, speed_sq, profile.status, profile.reason)
    accel, time = core.motion(track.station, speed_sq)
    label = column.limiting(speed_sq, accel, smoothed)
    highest, label = column.highest_verified(speed_sq, label)
    return SpeedPlan(
        candidate=name,
        status=status,
        reason=reason,
        station=track.station,
        x=column.x,
        y=column.y,
        z=column.z,
        grade=track.grade,
        roll=track.roll,
        curvature=track.curvature,
        speed=np.sqrt(speed_sq),
        accel=accel,
        time=time,
        speed_bound=np.sqrt(highest),
        limiting=label,
        stop_distance=profile.verdict.stop_distance,
        clear_distance=column.clear,
        rear_load=profile.verdict.rear_load,
        side_load=profile.verdict.side_load,
        obstacle=column.obstacle,
        momentum=column.momentum,
    )


def _smooth(
    column: CandidateColumn, speed_sq: Floats, start_accel: float | None
) -> tuple[Floats | None, Verification | None, str]:
    """A smooth profile below this one and its verification, or the reason without one."""
    if speed_sq[-1] > 0.0:
        raise AssertionError("a plan must rest at the end of its path")
    begin = len(column.fixed_prefix) - 1
    accel_max, decel_max = column.segment_limits(speed_sq)
    problem = SmoothingProblem(
        np.diff(column.track.station[begin:]),
        speed_sq[begin:],
        accel_max[begin:],
        decel_max[begin:],
        column.model.limits.jerk,
        start_accel,
    )
    # Where the verifier objects to the answer of the requested one, the default one is asked.
    for solver in dict.fromkeys((column.solver, _FIRST_SOLVER)):
        result = smooth(problem, solver)
        if result.speed_sq is None:
            return None, None, result.reason
        answer = np.concatenate((column.fixed_prefix[:-1], result.speed_sq))
        verdict = column.verify(answer)
        if verdict.valid:
            return answer, verdict, ""
    return None, None, "the verifier found a breach"


def _repair(column: CandidateColumn, speed_sq: Floats) -> tuple[Floats, Verification, str]:
    """Lower the bound where the verifier objects; at last slow the whole plan down."""
    fixed, verdict = column.fixed_prefix, column.verify(speed_sq)
    for _ in range(_REPAIRS):
        if verdict.valid:
            return speed_sq, verdict, ""
        for k in (verdict.where, verdict.where + 1):
            lower = np.minimum(column.bound[k], speed_sq[k]) * _REPAIR_SHARE
            column.lower_where_broken(k, lower, verdict.broken)
        answer, reachable = column.fastest()
        if not reachable:
            break
        speed_sq, verdict = answer, column.verify(answer)
    if verdict.valid:
        return speed_sq, verdict, ""
    worst = max(verdict.violation)
    name = verdict.violation._fields[int(np.argmax(verdict.violation))]
    share = 1.0
    for _ in range(40):
        share *= 0.9
        slower = speed_sq * share
        slower[: len(fixed)] = speed_sq[: len(fixed)]
        creeps = np.flatnonzero(np.maximum(slower[:-1], slower[1:]) <= core.STANDSTILL_SQ)
        if len(creeps):
            slower[max(int(creeps[0]), len(fixed)) :] = 0.0
        verdict = column.verify(slower)
        if verdict.valid:
            return slower, verdict, f"slowed to {share:.0%} of v²: {name} by {worst:.3g}"
    still = np.zeros_like(speed_sq)
    return still, column.verify(still), f"not driven: {name} by {worst:.3g} at any speed"
