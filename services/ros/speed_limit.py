"""From a plan to a speed limit for those who follow the path.

A limit is one number for all of the way until the next one. It is the lowest speed of the plan over
the time that it holds. Where that is less than motors can do, it is raised to ``launch``, if
emergency stops from that speed are within the plan's bounds over all of the way that can be driven
meanwhile. In nav2_msgs/SpeedLimit 0.0 means *no limit*, so a stop is a limit close to rest, and is
said beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.ros.settings import Timing
from services.wire.messages import Plan, PlanReply

_DRIVABLE = ("ok", "blocked", "degraded")


@dataclass(frozen=True, slots=True)
class SpeedAdvice:
    """What followers of the path are told.

    Attributes:
        limit: never 0 [m/s]. stop: stand still, or brake. reason: why, empty for a plain limit.
    """

    limit: float
    stop: bool
    reason: str


@dataclass(frozen=True, slots=True)
class PlanPosition:
    """The vehicle on a plan: station [m] and time [s] of the plan there, and the stations ahead."""

    station: float
    time: float
    ahead: int


def place_on(plan: Plan, x: float, y: float) -> PlanPosition:
    """The point of a plan that is nearest to a position [m]."""
    px, py, station, time = (plan.column(name) for name in ("x", "y", "station", "time"))
    dx, dy = np.diff(px), np.diff(py)
    length_sq = np.maximum(dx * dx + dy * dy, 1e-18)
    share = np.clip(((x - px[:-1]) * dx + (y - py[:-1]) * dy) / length_sq, 0.0, 1.0)
    away = np.hypot(px[:-1] + share * dx - x, py[:-1] + share * dy - y)
    k = int(np.argmin(away))
    u = float(share[k])
    v = plan.column("speed")
    here = float(np.sqrt((1.0 - u) * v[k] ** 2 + u * v[k + 1] ** 2))
    gone = u * float(station[k + 1] - station[k])
    mean = 0.5 * (float(v[k]) + here)
    late = gone / mean if mean > 0.0 else 0.0
    return PlanPosition(float(station[k]) + gone, float(time[k]) + late, k + 1)


def told_by(reply: PlanReply, x: float, y: float, timing: Timing) -> SpeedAdvice:
    """What an answer means for a vehicle at x, y [m]."""
    plan = next((p for p in reply.plans if p.candidate == reply.chosen), None)
    if reply.command is None or reply.command.stop or plan is None:
        return stop(timing, reply.reason or "no plan may be driven")
    if plan.status not in _DRIVABLE:
        return stop(timing, f"{plan.candidate}: {plan.status}: {plan.reason}")
    at = place_on(plan, x, y)
    limit = max(_lowest_ahead(plan, at, timing), _launch(plan, at, timing))
    if not limit > timing.crawl:
        return stop(timing, plan.reason or "the plan ends here")
    return SpeedAdvice(limit, False, plan.reason)


def _lowest_ahead(plan: Plan, at: PlanPosition, timing: Timing) -> float:
    """Lowest speed of the plan from the next limit on, as far as is looked ahead.

    v² is linear between stations, so it is at one of them, or at an end of the time.
    """
    time, speed, accel = (plan.column(name) for name in ("time", "speed", "accel"))
    first, last = at.time + timing.period, at.time + timing.life
    lowest = np.inf
    for moment in (first, last):
        m = int(np.clip(np.searchsorted(time, moment, "right") - 1, 0, len(time) - 1))
        ended = moment >= time[-1]
        now = 0.0 if ended else float(speed[m] + accel[m] * (moment - time[m]))
        lowest = min(lowest, max(now, 0.0))
    within = (time > first) & (time < last)
    return float(min(lowest, speed[within].min())) if within.any() else float(lowest)


def _launch(plan: Plan, at: PlanPosition, timing: Timing) -> float:
    """``launch``, or what the bounds leave of it over the way driven meanwhile."""
    if plan.status == "degraded":
        return 0.0
    station, bound = plan.column("station"), plan.column("speed_bound")
    reach = at.station + timing.launch * timing.life
    last = int(np.searchsorted(station, reach, "left")) + 1
    return float(min(timing.launch, bound[at.ahead - 1 : last].min()))


def stop(timing: Timing, reason: str) -> SpeedAdvice:
    """Stand still."""
    return SpeedAdvice(timing.crawl, True, reason)
