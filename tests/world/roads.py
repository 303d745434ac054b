"""Roads as the profile sees them, their smoothing problems, and an optimiser's answer to these."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from slopewise.planner.compiled_core import core
from slopewise.planner.planning_limits import PlanningLimits, planning_limits
from slopewise.planner.profile.problems import ProfileProblem, SmoothingProblem
from tests.world.vehicles import G, model_of, tables_with

BIG = 1e9


@dataclasses.dataclass
class Road:
    """One candidate as the profile sees it: level and strong in everything by default."""

    station: np.ndarray
    bound: np.ndarray
    sin_grade: np.ndarray
    lower_slope: np.ndarray
    lower_intercept: np.ndarray
    slowest: np.ndarray
    accel_max: np.ndarray
    demand: np.ndarray
    scalars: PlanningLimits
    start: float = 0.0

    def solve(self, **options: Any) -> tuple[np.ndarray, float]:
        columns = [
            np.ascontiguousarray(c[:, None])
            for c in (
                self.station,
                self.bound**2,
                self.sin_grade,
                self.lower_slope,
                self.lower_intercept,
                self.slowest,
                self.accel_max,
                self.demand,
            )
        ]
        limits = self.scalars
        problem = ProfileProblem(
            *columns, np.array([self.start**2]), limits.decel, limits.specific_power
        )
        speed_sq, reachable = core.time_optimal(problem._replace(**options))
        return speed_sq[:, 0], float(reachable[0])

    def braking(self, k: int, v: float) -> float:
        """Deceleration of the brakes at a station for a speed at onset."""
        force = max(v, self.slowest[k]) * self.lower_slope[k] + self.lower_intercept[k]
        return float(G * (force + self.sin_grade[k]))


def road(n: int = 101, ds: float = 0.1, **changes: Any) -> Road:
    fill = {
        "bound": 50.0,
        "sin_grade": 0.0,
        "lower_slope": 0.0,
        "lower_intercept": 2.0,
        "slowest": 0.0,
        "accel_max": 1.0,
        "demand": 0.0,
    }
    scalars = planning_limits(model_of(tables_with(vehicle={"max_drive_power": BIG})))
    columns = {
        name: np.broadcast_to(np.asarray(changes.pop(name, value), float), (n,)).copy()
        for name, value in fill.items()
    }
    columns["bound"][-1] = min(columns["bound"][-1], changes.pop("end", 0.0))
    model_changes = changes.pop("scalars", {})
    return Road(np.arange(n) * ds, **columns, scalars=scalars._replace(**model_changes), **changes)


TOLERANCE = 1e-6


def problem_of(r: Road, jerk: float, start_accel: float | None = None) -> SmoothingProblem:
    """The smoothing problem behind a road's time-optimal profile."""
    top, _ = r.solve()
    return SmoothingProblem(
        np.diff(r.station),
        top,
        np.minimum(r.accel_max[:-1], r.accel_max[1:]),
        np.full(len(top) - 1, r.scalars.decel),
        jerk,
        start_accel,
    )


def wavy(seed: int, n: int = 101, ds: float = 0.25, start: float = 1.0) -> Road:
    rng = np.random.default_rng(seed)
    s = ds * np.arange(n)
    bound = np.full(n, 2.5)
    for _ in range(3):
        bound += rng.uniform(0.0, 0.6) * np.sin(s / rng.uniform(0.8, 4.0) + rng.uniform(0.0, 6.3))
    if seed % 3 == 0:
        bound[n // 3] = 0.7
    return road(n, ds, bound=np.maximum(bound, 0.4), accel_max=1.0 + 0.3 * np.sin(s), start=start)


def moving(speed_sq: np.ndarray) -> np.ndarray:
    return speed_sq[1:] + speed_sq[:-1] > 1e-9


def travel_time(speed_sq: np.ndarray, ds: np.ndarray) -> float:
    v, go = np.sqrt(speed_sq), moving(speed_sq)
    return float((2.0 * ds[go] / (v[1:] + v[:-1])[go]).sum())


def excesses(p: SmoothingProblem, speed_sq: np.ndarray) -> dict[str, float]:
    """Largest violation of each exact constraint; negative is slack."""
    accel = np.diff(speed_sq) / (2.0 * p.ds)
    v, go = np.sqrt(speed_sq), moving(speed_sq)
    time = np.full_like(p.ds, np.inf)
    time[go] = (2.0 * p.ds)[go] / (v[1:] + v[:-1])[go]
    change = np.abs(np.diff(accel)) / (0.5 * (time[1:] + time[:-1]))
    moving_both = go[1:] & go[:-1]
    return {
        "speed": float(np.max(speed_sq - p.speed_sq_max)),
        "negative": float(np.max(-speed_sq)),
        "accel": float(np.max((accel - p.accel_max)[go], initial=-1.0)),
        "decel": float(np.max((-accel - p.decel_max)[go], initial=-1.0)),
        "jerk": float(np.max(change[moving_both] - p.jerk, initial=-1.0)),
    }


def assert_exact(p: SmoothingProblem, speed_sq: np.ndarray) -> None:
    for name, excess in excesses(p, speed_sq).items():
        assert excess <= TOLERANCE, (name, excess)
