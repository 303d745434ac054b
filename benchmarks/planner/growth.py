"""How times grow with stations and with candidates, and what memory a batch takes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..common.measure import peak_memory, summary, take_turns, timed
from ..common.scene import Scene, fan, laps
from .batch import stages
from .one_by_one import emitted, smoother_of, smoothing_problem, tasks_of
from .peers import PEERS

STATIONS, CANDIDATES = 100, 16
"""What stays the same while the other one grows."""

_SMOOTHED = 1000
"""Stations beyond which smoothing in one piece is not tried."""

_COMPARED = ("plain pass", "pass with braking", "profile", "poses to ranked plans")

Result = dict[str, Any]


def growth_with_stations(quick: bool) -> list[Result]:
    """Batches of few long candidates, and the tools that take one of them."""
    rows = []
    for stations in (100, 1000) if quick else (100, 1000, 10_000):
        scene = laps(stations, CANDIDATES)
        row = _growth(scene, 5 if quick else 15)
        [task] = tasks_of(scene, [CANDIDATES // 2])
        row["judge"] = emitted(scene, [CANDIDATES // 2], 1)[0]
        if stations <= _SMOOTHED:
            row["smoothing"] = _twice(smoother_of(smoothing_problem(scene, task)))
        for name in ("toppra", "CasADi + IPOPT"):
            try:
                row[name] = _twice(PEERS[name](task))
            except ImportError:
                continue
        rows.append(row)
    return rows


def growth_with_candidates(quick: bool) -> list[Result]:
    """Batches of 1, 4, 16, … candidates."""
    powers = range(6 if quick else 7)
    return [_growth(fan(STATIONS, 4**power), 10 if quick else 30) for power in powers]


def memory(scene: Scene) -> Result:
    """Arrays of one batch, and the most that this process has held [bytes]."""
    solved = scene.plan()
    arrays: dict[int, int] = {}
    for part in (solved, solved.profile, solved.ground, solved.bounds):
        for name in part.__slots__:
            value = getattr(part, name)
            if isinstance(value, np.ndarray) and 0 not in value.strides:
                arrays[value.ctypes.data] = value.nbytes
    return {"batch_arrays": sum(arrays.values()), "process_peak": peak_memory()}


def _growth(scene: Scene, rounds: int) -> Result:
    every = stages(scene, scene.plan())
    seconds = take_turns({name: every[name] for name in _COMPARED}, rounds)
    stations, candidates = scene.x.shape
    times = {name: summary(values) for name, values in seconds.items()}
    return {"stations": stations, "candidates": candidates, **times}


def _twice(solve: Any) -> dict[str, float]:
    return summary([timed(solve)[0] for _ in range(2)])
