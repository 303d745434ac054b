"""From a plan to a speed limit for those who follow the path.

A limit is one number for all of the way until the next one. It is the lowest speed of the plan over
the time that it holds. Where that is less than motors can do, it is raised to ``launch``, if
emergency stops from that speed are within the plan's bounds over all of the way that can be driven
meanwhile. A vehicle whose odometry is late is farther along than it shows: the limit holds for as
much longer, and a vehicle that could no longer stop is stopped. In nav2_msgs/SpeedLimit 0.0 means
*no limit*, so a stop is a limit close to rest, and is said beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.services.ros.settings import Timing
from slopewise.services.wire.plan_messages import Plan, PlanReply

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


def told_by(reply: PlanReply, x: float, y: float, timing: Timing, late: float = 0.0) -> SpeedAdvice:
    """What an answer means for a vehicle that was at x, y [m] at most ``late`` ago [s]."""
    plan = next((p for p in reply.plans if p.candidate == reply.chosen), None)
    if reply.command is None or reply.command.stop or plan is None:
        return stop(timing, reply.reason or "no plan may be driven")
    if plan.status not in _DRIVABLE:
        return stop(timing, f"{plan.candidate}: {plan.status}: {plan.reason}")
    at = place_on(plan, x, y)
    if (short := _shortfall(plan, at, late)) > 0.0:
        return stop(
            timing, f"odometry may be {late:.2f} s old: a stop may end {short:.2f} m too far"
        )
    limit = max(_lowest_ahead(plan, at, timing, late), _launch(plan, at, timing, late))
    if not limit > timing.crawl:
        return stop(timing, plan.reason or "the plan ends here")
    return SpeedAdvice(limit, False, plan.reason)


def _shortfall(plan: Plan, at: PlanPosition, late: float) -> float:
    """Distance by which a stop from where the vehicle may be passes the clear distance [m]."""
    station = plan.column("station")
    speed, distance = (
        float(np.interp(at.station, station, plan.column(name)))
        for name in ("speed", "stop_distance")
    )
    if not late * speed > 0.0:
        return 0.0
    return at.station + late * speed + distance - plan.clear_distance


def _lowest_ahead(plan: Plan, at: PlanPosition, timing: Timing, late: float) -> float:
    """Lowest speed of the plan from the next limit on, as far as is looked ahead.

    The vehicle is where the plan is now, or where it is up to ``late`` later [s].
    v² is linear between stations, so it is at one of them, or at an end of the time.
    """
    time, speed, accel = (plan.column(name) for name in ("time", "speed", "accel"))
    first, last = at.time + timing.period, at.time + timing.life + late
    lowest = np.inf
    for moment in (first, last):
        m = int(np.clip(np.searchsorted(time, moment, "right") - 1, 0, len(time) - 1))
        ended = moment >= time[-1]
        now = 0.0 if ended else float(speed[m] + accel[m] * (moment - time[m]))
        lowest = min(lowest, max(now, 0.0))
    within = (time > first) & (time < last)
    return float(min(lowest, speed[within].min())) if within.any() else float(lowest)


def _launch(plan: Plan, at: PlanPosition, timing: Timing, late: float) -> float:
    """``launch``, or what the bounds leave of it over the way driven meanwhile."""
    if plan.status == "degraded":
        return 0.0
    station, bound = plan.column("station"), plan.column("speed_bound")
    here = float(np.interp(at.station, station, plan.column("speed")))
    reach = at.station + max(timing.launch, here) * late + timing.launch * timing.life
    last = int(np.searchsorted(station, reach, "left")) + 1
    return float(min(timing.launch, bound[at.ahead - 1 : last].min()))


def stop(timing: Timing, reason: str) -> SpeedAdvice:
    """Stand still."""
    return SpeedAdvice(timing.crawl, True, reason)
