"""Speed that it takes to get over a hill that thrust alone cannot climb.

No plan counts on it: a vehicle that has to stop on such a hill can only go back. The speed is
reported, so that route planners and drivers know what is missing.

v dv = g (min(F/W, P/(W v)) − demand) ds, taken backwards from where thrust suffices again; on the
way there the vehicle may slow down to nothing. Validity: wheels that do not spin, and speeds that
are held by nothing but thrust and slope. Source: :mod:`slopewise.models.laws.drive`.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.planner.plan import Momentum
from slopewise.planner.planning_limits import PlanningLimits
from slopewise.planner.verify.verifier import Track

_CRAWL = 1e-3
"""Below this speed power is no matter [m/s]."""


def momentum_over(track: Track, foot: int, reach: int, limits: PlanningLimits) -> Momentum | None:
    """Least speeds with which the vehicle gets over what lies ahead of a station; None if at rest.

    Args:
        track: one candidate, N stations. foot: the last station that thrust can climb.
        reach: stations whose ground is known and may be driven on.
        limits: the model's.
    """
    demand = _demand(track, limits)[:reach]
    min_speed_sq = _min_speed_sq(track.station[:reach], demand, limits)
    if not min_speed_sq[foot] > 0.0:
        return None
    slowest = np.zeros_like(track.station)
    slowest[:reach] = np.sqrt(min_speed_sq)
    over = np.flatnonzero(min_speed_sq[foot:] <= 0.0)
    allowed = np.minimum(track.speed_limit[:reach], limits.speed)
    return Momentum(
        station=float(track.station[foot]),
        speed=float(slowest[foot]),
        until=float(track.station[foot + int(over[0])]),
        allowed=bool((slowest[:reach] <= allowed).all()),
        least_speed=slowest,
    )


def _demand(track: Track, limits: PlanningLimits) -> Floats:
    """Thrust that holds the speed, as a share of the weight, (N,)."""
    resistance = limits.resistance + limits.turning_drag * np.abs(track.curvature)
    demand: Floats = np.sin(track.grade) + resistance * np.cos(track.grade)
    return demand


def _min_speed_sq(station: Floats, demand: Floats, limits: PlanningLimits) -> Floats:
    """v² from which thrust just does to the end, (N,) [m²/s²]."""
    head = np.zeros_like(station)  # v²/2g

    def lacking(k: int, height: float) -> float:
        speed = max(float(np.sqrt(2.0 * GRAVITY * height)), _CRAWL)
        return float(demand[k]) - min(limits.specific_force, limits.specific_power / speed)

    for k in range(len(station) - 2, -1, -1):
        ds, after = float(station[k + 1] - station[k]), float(head[k + 1])
        ahead = lacking(k + 1, after)
        here = lacking(k, after + ds * max(ahead, 0.0))
        if after <= 0.0 and ahead < 0.0 < here:
            # Thrust suffices from somewhere between both stations on.
            head[k] = 0.5 * ds * here * here / (here - ahead)
            continue
        for _ in range(2):
            here = lacking(k, max(after + 0.5 * ds * (here + ahead), 0.0))
        head[k] = max(after + 0.5 * ds * (here + ahead), 0.0)
    result: Floats = 2.0 * GRAVITY * head
    return result
