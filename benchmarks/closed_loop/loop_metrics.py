"""What drives amount to: safety, speed, and how well stops were predicted."""

from __future__ import annotations

from typing import Any

import numpy as np

from .quad import LIMITS
from .records import DrivenScene

Result = dict[str, Any]


def summary(drives: list[DrivenScene], perfect: list[DrivenScene]) -> Result:
    """Figures of one policy.

    Args:
        drives: of the policy. perfect: of perfect knowledge on the same scenes, in the same order.
    """
    stops = [stop for drive in drives for stop in drive.stops]
    forced = [stop for stop in stops if stop.forced]
    excess = np.array([s.predicted - s.actual for s in stops])
    light = np.array([drive.least_share.min() < LIMITS.min_load for drive in drives])
    unavoidable = np.array([drive.least_share.min() < LIMITS.min_load for drive in perfect])
    distance = sum(drive.distance for drive in drives)
    moving = sum(drive.moving_time for drive in drives)
    return {
        "drives": len(drives),
        "finished": sum(drive.finished for drive in drives),
        "distance": distance,
        "forced_stops": len(forced),
        "own_stops": len(stops) - len(forced),
        "collisions": sum(drive.collisions for drive in drives),
        "past_clear": sum(drive.past_clear for drive in drives),
        "farthest_past": max(drive.farthest for drive in drives),
        "load_violations": int(light.sum()),
        "load_violations_avoidable": int((light & ~unavoidable).sum()),
        "least_load": float(min(drive.least_share.min() for drive in drives)),
        "least_wheel_load": float(min(drive.least_wheel for drive in drives)),
        "mean_speed": distance / moving,
        "track_error": float(np.quantile([drive.track_error for drive in drives], 0.95)),
        "steepest_deg": float(
            max(np.rad2deg(np.abs(drive.history[:, 5]).max()) for drive in drives)
        ),
        "covered": float(np.mean(excess >= 0.0)),
        "short": int(np.sum(excess < 0.0)),
        "worst_excess": float(excess.min()),
        "mean_excess": float(np.mean(excess)),
    }


def targets(results: dict[str, Result], own: str, perfect: str) -> list[Result]:
    """What was wanted beside what was reached."""
    r = results[own]

    def row(what: str, relation: str, wanted: float, reached: float) -> Result:
        passed = reached >= wanted if relation == ">=" else reached <= wanted
        return {
            "what": what,
            "relation": relation,
            "wanted": wanted,
            "reached": float(reached),
            "passed": bool(passed),
        }

    return [
        row("drives", ">=", 300, r["drives"]),
        row("forced stops", ">=", 1000, r["forced_stops"]),
        row("collisions", "<=", 0, r["collisions"]),
        row("stops past the clear distance", "<=", 0, r["past_clear"]),
        row(
            "load violations that perfect knowledge avoids",
            "<=",
            0,
            r["load_violations_avoidable"],
        ),
        row(
            "mean speed, share of perfect knowledge",
            ">=",
            0.85,
            r["mean_speed"] / results[perfect]["mean_speed"],
        ),
        row("stops not longer than predicted, share", ">=", 0.999, r["covered"]),
        row("mean excess of the prediction [m]", "<=", 0.25, r["mean_excess"]),
    ]
