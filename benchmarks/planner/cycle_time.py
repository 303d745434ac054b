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
from typing import Any

import numpy as np
from rich.console import Console

from slopewise.planner.horizon.answer import CycleAnswer
from slopewise.planner.plan import Status

from ..common.campaign import BenchmarkRequest, Progress
from ..common.text_tables import duration, table_of
from ..common.timing import background_load, machine, on_one_core, resident_memory
from .horizon_drive import CANDIDATES, SMOOTHED, STATIONS, HorizonDrive

CYCLES, QUICK_CYCLES = 10_000, 500
HOUR_OF_CYCLES, QUICK_MEMORY_CYCLES = 36_000, 1_000
"""Cycles of a whole and of a quick run [1]; those for memory are an hour at 10 Hz."""
TARGET_P50, TARGET_P99 = 3e-3, 10e-3
"""Of a cycle that runs alone [s]: a cycle has 20 ms, shared with drivers and localisation."""

_WARM_UP = 100  # cycles that are not timed
Result = dict[str, Any]
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
        """Count one cycle."""
        self.seconds.append(seconds)
        self.processor.append(processor)
        self.stages.update(answer.seconds)
        self.statuses[answer.status.value] += 1
        late = any(p.status is Status.DEGRADED and "within" in p.reason for p in answer.plans)
        possible = min(SMOOTHED, sum(ranked.cost < np.inf for ranked in answer.ranking))
        self.fewer += late or len(answer.plans) < possible

    def result(self, name: str, metres: float) -> Result:
        """Figures as plain data."""
        cycles = len(self.seconds)
        return {
            "name": name,
            "cycles": cycles,
            "p50": float(np.percentile(self.seconds, 50)),
            "p99": float(np.percentile(self.seconds, 99)),
            "max": float(max(self.seconds)),
            "processor_p50": float(np.percentile(self.processor, 50)),
            "processor_p99": float(np.percentile(self.processor, 99)),
            "fewer_smoothed": self.fewer / cycles,
            "stages": {stage: total / cycles for stage, total in self.stages.items()},
            "statuses": dict(self.statuses),
            "metres": metres,
        }


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Drive alone and under load, then measure memory."""
    cycles = QUICK_CYCLES if request.quick else CYCLES
    memory_cycles = QUICK_MEMORY_CYCLES if request.quick else HOUR_OF_CYCLES
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
    """Print the table and the memory."""
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
