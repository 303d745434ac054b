"""Growth of times with stations and with candidates, and the memory of a batch."""

from __future__ import annotations

from typing import Any

import numpy as np

from slopewise.planner.profile.smoothing import smooth

from ..common.scene import BenchmarkScene, fan, laps
from ..common.timing import interleave, peak_memory, summary, timed
from .batch import stages
from .planner_baselines import BASELINES
from .solver_comparison import emitted, smoothing_problem, tasks_of

STATIONS, CANDIDATES = 100, 16
"""Constant while the other one grows."""

_MAX_SMOOTHED = 1000
"""Stations above which smoothing in one piece is not tried: a plan is never longer."""

_COMPARED = ("plain pass", "pass with braking", "profile", "poses to ranked plans")

Result = dict[str, Any]


def growth_with_stations(quick: bool) -> list[Result]:
    """Batches of few long candidates, and the tools that take one of them."""
    rows = []
    middle = [CANDIDATES // 2]
    for stations in (100, 1000) if quick else (100, 1000, 10_000):
        scene = laps(stations, CANDIDATES)
        row = _growth(scene, 5 if quick else 15)
        [task] = tasks_of(scene, middle)
        row["judge"] = emitted(scene, middle, 1)[0]
        if stations <= _MAX_SMOOTHED:
            problem = smoothing_problem(scene, task)
            row["smoothing"] = _twice(lambda problem=problem: smooth(problem))
        for name in ("toppra", "CasADi + IPOPT"):
            try:
                row[name] = _twice(BASELINES[name](task))
            except ImportError:
                continue
        rows.append(row)
    return rows


def growth_with_candidates(quick: bool) -> list[Result]:
    """Batches of 1, 4, 16, … candidates."""
    powers = range(6 if quick else 7)
    return [_growth(fan(STATIONS, 4**power), 10 if quick else 30) for power in powers]


def memory(scene: BenchmarkScene) -> Result:
    """Arrays of one batch, and peak memory of this process [bytes]."""
    solved = scene.plan()
    arrays: dict[int, int] = {}
    for part in (solved, solved.profile, solved.ground, solved.bounds):
        for name in part.__slots__:
            value = getattr(part, name)
            if isinstance(value, np.ndarray) and 0 not in value.strides:
                arrays[value.ctypes.data] = value.nbytes
    return {"batch_arrays": sum(arrays.values()), "process_peak": peak_memory()}


def _growth(scene: BenchmarkScene, rounds: int) -> Result:
    every = stages(scene, scene.plan())
    seconds = interleave({name: every[name] for name in _COMPARED}, rounds)
    stations, candidates = scene.x.shape
    times = {name: summary(values) for name, values in seconds.items()}
    return {"stations": stations, "candidates": candidates, **times}


def _twice(solve: Any) -> dict[str, float]:
    return summary([timed(solve)[0] for _ in range(2)])
