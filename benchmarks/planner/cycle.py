"""How long one cycle of the moving horizon takes, while a vehicle drives through hills for hours.

A fan of candidates is drawn from the vehicle's pose and kept for some cycles, as local planners do;
the vehicle follows each cycle's command. The cycle runs on one core, alone, beside other cores that
work, and against as many working processes as there are cores.
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

from ..common.load import on_one_core, resident_memory, working
from ..common.measure import machine
from ..common.tables import duration, table_of
from .driving import CANDIDATES, SMOOTHED, STATIONS, EndlessDrive

CYCLES, QUICK_CYCLES = 10_000, 500
HOUR_OF_CYCLES, QUICK_MEMORY_CYCLES = 36_000, 1_000
WANTED_P50, WANTED_P99 = 3e-3, 10e-3
_WARM_UP = 100
Result = dict[str, Any]


@dataclass(slots=True)
class Tally:
    """What a run of cycles adds up to."""

    seconds: list[float] = field(default_factory=list)
    worked: list[float] = field(default_factory=list)
    stages: Counter[str] = field(default_factory=Counter)
    statuses: Counter[str] = field(default_factory=Counter)
    fewer: int = 0

    def add(self, seconds: float, worked: float, answer: CycleAnswer) -> None:
        """One cycle."""
        self.seconds.append(seconds)
        self.worked.append(worked)
        self.stages.update(answer.seconds)
        self.statuses[answer.status.value] += 1
        late = any(p.status is Status.DEGRADED and "within" in p.reason for p in answer.plans)
        possible = min(SMOOTHED, sum(ranked.cost < np.inf for ranked in answer.ranking))
        self.fewer += late or len(answer.plans) < possible

    def result(self, name: str, metres: float) -> Result:
        """As plain data."""
        cycles, times = len(self.seconds), np.array(self.seconds)
        return {
            "name": name,
            "cycles": cycles,
            "p50": float(np.percentile(times, 50)),
            "p99": float(np.percentile(times, 99)),
            "max": float(times.max()),
            "processor_p50": float(np.percentile(self.worked, 50)),
            "processor_p99": float(np.percentile(self.worked, 99)),
            "fewer_smoothed": self.fewer / cycles,
            "stages": {stage: total / cycles for stage, total in self.stages.items()},
            "statuses": dict(self.statuses),
            "metres": metres,
        }


def run(quick: bool = False, progress: Callable[[int], None] | None = None) -> Result:
    """Drive alone, beside work on other cores, and against it; then watch memory."""
    cycles = QUICK_CYCLES if quick else CYCLES
    cores = os.cpu_count() or 1
    runs = []
    with on_one_core() as own:
        others = sorted(set(range(cores)) - {own})
        for name, busy in (
            ("alone", []),
            ("other cores busy", [{core} for core in others]),
            ("all cores busy", [set(range(cores))] * cores),
        ):
            with working(busy):
                runs.append(timed_drive(name, cycles, progress))
        watched = memory(QUICK_MEMORY_CYCLES if quick else HOUR_OF_CYCLES, progress)
    return {
        "quick": quick,
        "machine": machine(),
        "problem": {"candidates": CANDIDATES, "stations": STATIONS, "smoothed": SMOOTHED},
        "runs": runs,
        "memory": watched,
        "wanted": {"p50": WANTED_P50, "p99": WANTED_P99},
    }


def total(quick: bool) -> int:
    """Cycles that :func:`run` reports to ``progress``."""
    if quick:
        return 3 * QUICK_CYCLES + QUICK_MEMORY_CYCLES
    return 3 * CYCLES + HOUR_OF_CYCLES


def timed_drive(name: str, cycles: int, progress: Callable[[int], None] | None = None) -> Result:
    """So many cycles after a few that do not count."""
    drive, tally = EndlessDrive(), Tally()
    for _ in range(_WARM_UP):
        drive.step()
    for _ in range(cycles):
        tally.add(*drive.step())
        if progress is not None:
            progress(1)
    return tally.result(name, drive.metres)


def memory(cycles: int, progress: Callable[[int], None] | None = None) -> Result:
    """What is held more after so many cycles than after the first quarter of them [bytes]."""
    drive = EndlessDrive()
    for _ in range(_WARM_UP):
        drive.step()
    tracemalloc.start()
    held, resident = [], []
    try:
        for cycle in range(1, cycles + 1):
            drive.step()
            if progress is not None:
                progress(1)
            if cycle % max(cycles // 40, 1) == 0:
                held.append(tracemalloc.get_traced_memory()[0])
                resident.append(resident_memory())
    finally:
        tracemalloc.stop()
    quarter = len(held) // 4
    return {
        "cycles": cycles,
        "traced_growth": float(np.median(held[-quarter:]) - np.median(held[quarter : 2 * quarter])),
        "resident_growth": float(resident[-1] - resident[quarter]),
        "resident": float(resident[-1]),
    }


def show(result: Result, console: Console | None = None) -> None:
    """Print tables."""
    screen = console or Console()
    problem = result["problem"]
    table = table_of(
        f"One cycle: {problem['candidates']} candidates of {problem['stations']} stations, "
        f"{problem['smoothed']} finished, one core",
        *(run_["name"] for run_ in result["runs"]),
    )
    wanted = result["wanted"]
    for name in ("p50", "p99", "max"):
        limit = f" (wanted ≤ {duration(wanted[name])})" if name in wanted else ""
        table.add_row(f"{name}{limit}", *(duration(r[name]) for r in result["runs"]))
    for name in ("p50", "p99"):
        cells = (duration(r[f"processor_{name}"]) for r in result["runs"])
        table.add_row(f"{name} of processor time", *cells)
    table.add_row("fewer smoothed", *(f"{r['fewer_smoothed']:.2%}" for r in result["runs"]))
    for stage in result["runs"][0]["stages"]:
        cells = (duration(r["stages"].get(stage, 0.0)) for r in result["runs"])
        table.add_row(f"mean of {stage}", *cells)
    table.add_row("driven", *(f"{r['metres']:.0f} m" for r in result["runs"]))
    table.add_row(
        "answers",
        *(", ".join(f"{n} {s}" for s, n in r["statuses"].items()) for r in result["runs"]),
    )
    screen.print(table)
    held = result["memory"]
    screen.print(
        f"memory over {held['cycles']} cycles: objects {held['traced_growth'] / 1e3:+.1f} kB, "
        f"process {held['resident_growth'] / 1e6:+.1f} MB of {held['resident'] / 1e6:.0f} MB"
    )
