"""A vehicle that drives through hills for ever, cycle by cycle of the moving horizon."""

from __future__ import annotations

from time import perf_counter, thread_time

import numpy as np

from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import CycleAnswer, PlanarState
from slopewise.planner.horizon.horizon import Horizon, HorizonSettings
from slopewise.planner.path import PathBatch
from slopewise.planner.plan import SpeedPlan

from ..common.scene import SPACING, atv, hills

CANDIDATES, STATIONS, SMOOTHED = 64, 100, 4
_PERIOD = 0.1
_KEPT = 25
"""Cycles for which a fan is kept."""

_SHARPEST = 0.15  # [1/m]
_PATIENCE = 10
"""Cycles at rest after which the vehicle turns round on the spot."""


class EndlessDrive:
    """A vehicle that drives where the horizon leads it."""

    def __init__(self, cycles_a_fan: int = _KEPT, budget: float = 0.02) -> None:
        """Begin in the middle of the map, at rest.

        Args:
            cycles_a_fan: cycles for which a fan is kept.
            budget: time for a cycle [s].
        """
        self._map = hills(patches=6)
        settings = HorizonSettings(smoothed=SMOOTHED, period=_PERIOD, budget=budget)
        self.horizon = Horizon(atv(), settings, uncertainty=Uncertainty(slope_std=0.002))
        self._kept = cycles_a_fan
        self._x, self._y, self._heading, self._speed = 40.0, 40.0, 0.0, 0.0
        self._cycle, self._waited = 0, 0
        self._fan = self._draw()
        self.metres = 0.0

    def step(self) -> tuple[float, float, CycleAnswer]:
        """One cycle, and what the vehicle does after it.

        Returns:
            Seconds by the clock, seconds of the processor, and the answer.
        """
        if self._cycle % self._kept == 0:
            self._fan = self._draw()
        self._cycle += 1
        state = PlanarState(x=self._x, y=self._y, heading=self._heading, speed=self._speed)
        worked, begun = thread_time(), perf_counter()
        answer = self.horizon.step(state, self._fan, self._map)
        seconds, worked = perf_counter() - begun, thread_time() - worked
        self._obey(answer)
        return seconds, worked, answer

    def _draw(self) -> PathBatch:
        """Arcs from where the vehicle is."""
        curvature = np.linspace(-_SHARPEST, _SHARPEST, CANDIDATES)
        s = SPACING * np.arange(STATIONS)[:, None]
        # Chords of an arc, so that neighbouring stations are as far apart as on the arc.
        heading = self._heading + curvature * (s[:-1] + 0.5 * SPACING)
        start = np.zeros((1, CANDIDATES))
        x = self._x + np.vstack((start, SPACING * np.cumsum(np.cos(heading), axis=0)))
        y = self._y + np.vstack((start, SPACING * np.cumsum(np.sin(heading), axis=0)))
        names = tuple(f"{self._cycle // self._kept}.{j}" for j in range(CANDIDATES))
        return PathBatch(names, x, y, np.full(CANDIDATES, STATIONS), None)

    def _obey(self, answer: CycleAnswer) -> None:
        plan, wanted = answer.chosen, answer.command.speed
        way = 0.5 * (self._speed + wanted) * _PERIOD
        if plan is not None and way > 0.0:
            self._x, self._y, self._heading = _further(plan, self._x, self._y, way)
        self._speed = wanted
        self.metres += way
        self._waited = self._waited + 1 if wanted <= 0.01 else 0
        if self._waited >= _PATIENCE:
            self._heading += 1.0
            self._speed, self._waited = 0.0, 0
            self.horizon.forget()
            self._cycle = -(-self._cycle // self._kept) * self._kept


def _further(plan: SpeedPlan, x: float, y: float, way: float) -> tuple[float, float, float]:
    """Pose a way further along a plan [m]."""
    dx, dy = np.diff(plan.x), np.diff(plan.y)
    length = np.maximum(np.hypot(dx, dy), 1e-9)
    along = np.clip(((x - plan.x[:-1]) * dx + (y - plan.y[:-1]) * dy) / length, 0.0, length)
    off = np.hypot(plan.x[:-1] + along * dx / length - x, plan.y[:-1] + along * dy / length - y)
    k = int(np.argmin(off))
    passed = np.concatenate(([0.0], np.cumsum(length)))
    target = min(float(passed[k] + along[k]) + way, float(passed[-1]))
    k = int(np.clip(np.searchsorted(passed, target, "right") - 1, 0, len(length) - 1))
    u = (target - passed[k]) / length[k]
    return (
        float(plan.x[k] + u * dx[k]),
        float(plan.y[k] + u * dy[k]),
        float(np.arctan2(dy[k], dx[k])),
    )
