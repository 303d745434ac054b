"""Time of one cycle of the moving horizon, while a vehicle drives through hills for hours.

Candidates are drawn from the vehicle's pose and offered for some cycles, as local planners do; the
vehicle follows each cycle's command. The cycle runs on one core: alone, while other cores are busy,
and while as many processes as cores compete with it.
"""

from __future__ import annotations

import os
import tracemalloc
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter, thread_time
from typing import Any

import numpy as np
from rich.console import Console

from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import CycleAnswer, PlanarState
from slopewise.planner.horizon.horizon import Horizon, HorizonSettings
from slopewise.planner.path import PathBatch
from slopewise.planner.plan import SpeedPlan, Status

from ..common.campaign import BenchmarkRequest, Progress, Result
from ..common.scene import SPACING, atv, hills
from ..common.text_tables import duration, table_of
from ..common.timing import background_load, machine, on_one_core, resident_memory

CANDIDATES, STATIONS, SMOOTHED = 64, 100, 4  # of a cycle, 25 m long
_PERIOD = 0.1  # [s] of a cycle, as on a robot
_CYCLES_PER_FAN = 25  # a local planner offers new candidates every few seconds
_MAX_CURVATURE = 0.15  # [1/m]
_PATIENCE = 10  # cycles at rest after which the vehicle turns on the spot
_TURN = 1.0  # [rad] of that


class HorizonDrive:
    """A vehicle that follows the commands of the horizon."""

    def __init__(self, cycles_per_fan: int = _CYCLES_PER_FAN, budget: float = 0.02) -> None:
        """Begin in the middle of the map, at rest, with a budget for each cycle [s]."""
        self._map = hills(patches=6)
        settings = HorizonSettings(smoothed=SMOOTHED, period=_PERIOD, budget=budget)
        self.horizon = Horizon(atv(), settings, uncertainty=Uncertainty(slope_std=0.002))
        self._cycles_per_fan = cycles_per_fan
        self._x, self._y, self._heading, self._speed = 40.0, 40.0, 0.0, 0.0
        self._cycle, self._waited = 0, 0
        self._fan = self.draw_fan()
        self.metres = 0.0  # driven so far [m]

    def step(self) -> tuple[float, float, CycleAnswer]:
        """Plan one cycle and follow its command; seconds by clock and processor, and the answer."""
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
        return PathBatch.of_stations(names, x, y, np.full(CANDIDATES, STATIONS))

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


FULL, QUICK = (10_000, 36_000), (500, 1_000)  # timed cycles, and those for memory: 1 h at 10 Hz
TARGET_P50, TARGET_P99 = 3e-3, 10e-3  # of a cycle that runs alone, of 20 ms for all programs [s]

_WARM_UP = 100  # cycles that are not timed
Advance = Callable[[int], Any]


@dataclass(slots=True)
class TimingTally:
    """Times and statuses of a run of cycles."""

    seconds: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)
    stages: Counter[str] = field(default_factory=Counter)
    statuses: Counter[str] = field(default_factory=Counter)
    fewer: int = 0

    def add(self, seconds: float, processor: float, answer: CycleAnswer) -> None:
        self.seconds.append(seconds)
        self.processor.append(processor)
        self.stages.update(answer.seconds)
        self.statuses[answer.status.value] += 1
        late = any(p.status is Status.DEGRADED and "within" in p.reason for p in answer.plans)
        possible = min(SMOOTHED, sum(ranked.cost < np.inf for ranked in answer.ranking))
        self.fewer += late or len(answer.plans) < possible

    def result(self, name: str, metres: float) -> Result:
        cycles = len(self.seconds)
        p50, p99 = np.percentile(self.seconds, (50, 99)).tolist()
        processor_p50, processor_p99 = np.percentile(self.processor, (50, 99)).tolist()
        row = {"name": name, "cycles": cycles, "p50": p50, "p99": p99, "max": max(self.seconds)}
        row |= {"processor_p50": processor_p50, "processor_p99": processor_p99}
        row |= {"fewer_smoothed": self.fewer / cycles, "statuses": dict(self.statuses)}
        stages = {stage: total / cycles for stage, total in self.stages.items()}
        return row | {"stages": stages, "metres": metres}


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Drive alone and under load, then measure memory."""
    cycles, memory_cycles = QUICK if request.quick else FULL
    advance = progress("cycle", 3 * cycles + memory_cycles)
    cores = os.cpu_count() or 1
    runs = []
    with on_one_core() as core:
        free_cores = sorted(set(range(cores)) - {core})
        for name, busy in (
            ("alone", []),
            ("other cores busy", [{number} for number in free_cores]),
            ("all cores busy", [set(range(cores))] * cores),
        ):
            with background_load(busy):
                runs.append(timed_drive(name, cycles, advance))
        held = memory(memory_cycles, advance)
    return {
        "quick": request.quick,
        "machine": machine(),
        "problem": {"candidates": CANDIDATES, "stations": STATIONS, "smoothed": SMOOTHED},
        "runs": runs,
        "memory": held,
        "wanted": {"p50": TARGET_P50, "p99": TARGET_P99},
    }


def timed_drive(name: str, cycles: int, advance: Advance) -> Result:
    """Time cycles after a warm-up."""
    drive, tally = _warm_drive(), TimingTally()
    for _ in range(cycles):
        tally.add(*drive.step())
        advance(1)
    return tally.result(name, drive.metres)


def memory(cycles: int, advance: Advance) -> Result:
    """Growth of memory from the first quarter of a drive to its end [bytes]."""
    drive = _warm_drive()
    tracemalloc.start()
    traced, resident = [], []
    try:
        for cycle in range(1, cycles + 1):
            drive.step()
            advance(1)
            if cycle % max(cycles // 40, 1) == 0:
                traced.append(tracemalloc.get_traced_memory()[0])
                resident.append(resident_memory())
    finally:
        tracemalloc.stop()
    quarter = len(traced) // 4
    growth = np.median(traced[-quarter:]) - np.median(traced[quarter : 2 * quarter])
    return {
        "cycles": cycles,
        "traced_growth": float(growth),
        "resident_growth": float(resident[-1] - resident[quarter]),
        "resident": float(resident[-1]),
    }


def _warm_drive() -> HorizonDrive:
    drive = HorizonDrive()
    for _ in range(_WARM_UP):
        drive.step()
    return drive


def show(result: Result, console: Console) -> None:
    runs, targets = result["runs"], result["wanted"]
    problem = result["problem"]
    table = table_of(
        f"One cycle: {problem['candidates']} candidates of {problem['stations']} stations, "
        f"{problem['smoothed']} finished, one core",
        *(run_["name"] for run_ in runs),
    )
    for name in ("p50", "p99", "max"):
        limit = f" (target ≤ {duration(targets[name])})" if name in targets else ""
        table.add_row(f"{name}{limit}", *(duration(r[name]) for r in runs))
    for name in ("p50", "p99"):
        times = (duration(r[f"processor_{name}"]) for r in runs)
        table.add_row(f"{name} of processor time", *times)
    table.add_row("fewer smoothed", *(f"{r['fewer_smoothed']:.2%}" for r in runs))
    for stage in runs[0]["stages"]:
        table.add_row(f"mean of {stage}", *(duration(r["stages"].get(stage, 0.0)) for r in runs))
    table.add_row("driven", *(f"{r['metres']:.0f} m" for r in runs))
    statuses = (", ".join(f"{n} {s}" for s, n in r["statuses"].items()) for r in runs)
    table.add_row("answers", *statuses)
    console.print(table)
    held = result["memory"]
    console.print(
        f"memory over {held['cycles']} cycles: objects {held['traced_growth'] / 1e3:+.1f} kB, "
        f"process {held['resident_growth'] / 1e6:+.1f} MB of {held['resident'] / 1e6:.0f} MB"
    )
