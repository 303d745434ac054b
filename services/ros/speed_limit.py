"""Speed limit for followers of a path, from a plan.

A limit is one number for the distance until the next one. It is the lowest speed of the plan over
the time that it holds. Where that is less than motors can do, it is raised to ``launch``, if
emergency stops from that speed are within the plan's bounds over all the distance that can be
driven meanwhile. A vehicle whose odometry is late is farther along than it shows: the limit holds
for that much longer, and a vehicle that could no longer stop is stopped. In nav2_msgs/SpeedLimit
0.0 means *no limit*, so a stop is a limit close to rest, and a separate flag.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.services.ros.settings import Timing
from slopewise.services.wire.plan_messages import Plan, PlanReply

_DRIVABLE = ("ok", "blocked", "degraded")


@dataclass(frozen=True, slots=True)
class SpeedAdvice:
    """Advice to followers of the path."""

    limit: float  # never 0 [m/s]
    stop: bool
    reason: str  # as text, empty for a limit without one


@dataclass(frozen=True, slots=True)
class PlanPosition:
    """Position on a plan: its station [m] and time [s], and the index of the next station."""

    station: float
    time: float
    ahead: int


def place_on(plan: Plan, x: float, y: float) -> PlanPosition:
    """Point of a plan that is nearest to a position [m]."""
    px, py, station, time, v = map(plan.column, ("x", "y", "station", "time", "speed"))
    dx, dy = np.diff(px), np.diff(py)
    length_sq = np.maximum(dx * dx + dy * dy, 1e-18)
    share = np.clip(((x - px[:-1]) * dx + (y - py[:-1]) * dy) / length_sq, 0.0, 1.0)
    distance = np.hypot(px[:-1] + share * dx - x, py[:-1] + share * dy - y)
    k = int(np.argmin(distance))
    u = float(share[k])
    here = float(np.sqrt((1.0 - u) * v[k] ** 2 + u * v[k + 1] ** 2))
    driven = u * float(station[k + 1] - station[k])
    mean = 0.5 * (float(v[k]) + here)
    passed = driven / mean if mean > 0.0 else 0.0
    return PlanPosition(float(station[k]) + driven, float(time[k]) + passed, k + 1)


def advice_from_reply(
    reply: PlanReply, x: float, y: float, timing: Timing, late: float = 0.0
) -> SpeedAdvice:
    """Advice to a vehicle that was at x, y [m] at most ``late`` ago [s]."""
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


def stop(timing: Timing, reason: str) -> SpeedAdvice:
    """Advice to stand still."""
    return SpeedAdvice(timing.crawl, True, reason)


def _at(plan: Plan, station: float, name: str) -> float:
    """Value of a column at a station."""
    return float(np.interp(station, plan.column("station"), plan.column(name)))


def _shortfall(plan: Plan, at: PlanPosition, late: float) -> float:
    """Distance by which a stop from where the vehicle may be passes the clear distance [m]."""
    driven = late * _at(plan, at.station, "speed")
    if not driven > 0.0:
        return 0.0
    return at.station + driven + _at(plan, at.station, "stop_distance") - plan.clear_distance


def _lowest_ahead(plan: Plan, at: PlanPosition, timing: Timing, late: float) -> float:
    """Lowest speed of the plan from the next limit on, over the time that it holds [m/s].

    The vehicle is where the plan is now, or where it is up to ``late`` later [s].
    v² is linear between stations, so the lowest is at one of them, or at an end of the time.
    """
    time, speed, accel = map(plan.column, ("time", "speed", "accel"))
    first, last = at.time + timing.period, at.time + timing.life + late
    lowest = np.inf
    for moment in (first, last):
        m = int(np.clip(np.searchsorted(time, moment, "right") - 1, 0, len(time) - 1))
        has_ended = moment >= time[-1]
        now = 0.0 if has_ended else float(speed[m] + accel[m] * (moment - time[m]))
        lowest = min(lowest, max(now, 0.0))
    within = speed[(time > first) & (time < last)]
    return float(min(lowest, within.min(initial=np.inf)))


def _launch(plan: Plan, at: PlanPosition, timing: Timing, late: float) -> float:
    """Speed ``launch``, or what the bounds permit over the distance driven meanwhile [m/s]."""
    if plan.status == "degraded":
        return 0.0
    station, bound = plan.column("station"), plan.column("speed_bound")
    speed = max(timing.launch, _at(plan, at.station, "speed"))
    reach = at.station + speed * late + timing.launch * timing.life
    last = int(np.searchsorted(station, reach, "left")) + 1
    return float(min(timing.launch, bound[at.ahead - 1 : last].min()))
