"""A vehicle that drives through hills without end, cycle by cycle of the moving horizon."""

from __future__ import annotations

from time import perf_counter, thread_time

import numpy as np

from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import CycleAnswer, PlanarState
from slopewise.planner.horizon.horizon import Horizon, HorizonSettings
from slopewise.planner.path import PathBatch
from slopewise.planner.plan import SpeedPlan

from ..common.scene import SPACING, atv, hills

CANDIDATES, STATIONS, SMOOTHED = 64, 100, 4  # of a cycle, 25 m long
_PERIOD = 0.1  # [s] of a cycle, as on a robot
_CYCLES_PER_FAN = 25  # a local planner offers new candidates every few seconds
_MAX_CURVATURE = 0.15  # [1/m]
_PATIENCE = 10  # cycles at rest after which the vehicle turns on the spot
_TURN = 1.0  # [rad] of that


class HorizonDrive:
    """A vehicle that follows the commands of the horizon.

    Attributes:
        metres: driven so far [m].
    """

    def __init__(self, cycles_per_fan: int = _CYCLES_PER_FAN, budget: float = 0.02) -> None:
        """Begin in the middle of the map, at rest.

        Args:
            cycles_per_fan: cycles after which candidates are drawn again.
            budget: time for a cycle [s].
        """
        self._map = hills(patches=6)
        settings = HorizonSettings(smoothed=SMOOTHED, period=_PERIOD, budget=budget)
        self.horizon = Horizon(atv(), settings, uncertainty=Uncertainty(slope_std=0.002))
        self._cycles_per_fan = cycles_per_fan
        self._x, self._y, self._heading, self._speed = 40.0, 40.0, 0.0, 0.0
        self._cycle, self._waited = 0, 0
        self._fan = self.draw_fan()
        self.metres = 0.0

    def step(self) -> tuple[float, float, CycleAnswer]:
        """Plan one cycle and follow its command.

        Returns:
            Seconds by the clock, seconds of the processor, and the answer.
        """
        if self._cycle % self._cycles_per_fan == 0:
            self._fan = self.draw_fan()
        self._cycle += 1
        state = PlanarState(x=self._x, y=self._y, heading=self._heading, speed=self._speed)
        processor, start = thread_time(), perf_counter()
        answer = self.horizon.step(state, self._fan, self._map)
        seconds, processor = perf_counter() - start, thread_time() - processor
        self._obey(answer)
        return seconds, processor, answer

    def draw_fan(self) -> PathBatch:
        """Arcs from the vehicle's pose."""
        curvature = np.linspace(-_MAX_CURVATURE, _MAX_CURVATURE, CANDIDATES)
        s = SPACING * np.arange(STATIONS)[:, None]
        # Chords of an arc, so that neighbouring stations are as far apart as on the arc.
        heading = self._heading + curvature * (s[:-1] + 0.5 * SPACING)
        start = np.zeros((1, CANDIDATES))
        x = self._x + np.vstack((start, SPACING * np.cumsum(np.cos(heading), axis=0)))
        y = self._y + np.vstack((start, SPACING * np.cumsum(np.sin(heading), axis=0)))
        names = tuple(f"{self._cycle // self._cycles_per_fan}.{j}" for j in range(CANDIDATES))
        return PathBatch(names, x, y, np.full(CANDIDATES, STATIONS), None)

    def _obey(self, answer: CycleAnswer) -> None:
        plan, speed = answer.chosen, answer.command.speed
        distance = 0.5 * (self._speed + speed) * _PERIOD
        if plan is not None and distance > 0.0:
            self._x, self._y, self._heading = _pose_ahead(plan, self._x, self._y, distance)
        self._speed = speed
        self.metres += distance
        self._waited = self._waited + 1 if speed <= 0.01 else 0
        if self._waited >= _PATIENCE:
            self._heading += _TURN
            self._speed, self._waited = 0.0, 0
            self.horizon.forget()
            self._cycle = -(-self._cycle // self._cycles_per_fan) * self._cycles_per_fan


def _pose_ahead(plan: SpeedPlan, x: float, y: float, distance: float) -> tuple[float, float, float]:
    """Pose at a distance ahead along a plan [m]."""
    dx, dy = np.diff(plan.x), np.diff(plan.y)
    length = np.maximum(np.hypot(dx, dy), 1e-9)
    along = np.clip(((x - plan.x[:-1]) * dx + (y - plan.y[:-1]) * dy) / length, 0.0, length)
    away = np.hypot(plan.x[:-1] + along * dx / length - x, plan.y[:-1] + along * dy / length - y)
    k = int(np.argmin(away))
    passed = np.concatenate(([0.0], np.cumsum(length)))
    target = min(float(passed[k] + along[k]) + distance, float(passed[-1]))
    k = int(np.clip(np.searchsorted(passed, target, "right") - 1, 0, len(length) - 1))
    u = (target - passed[k]) / length[k]
    heading = float(np.arctan2(dy[k], dx[k]))
    return float(plan.x[k] + u * dx[k]), float(plan.y[k] + u * dy[k]), heading
