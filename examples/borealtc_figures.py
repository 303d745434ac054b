"""How well terrain is told on BorealTC: parameters, classes of unseen runs, changes of ground.

    python examples/borealtc_figures.py path/to/borealtc

Classes are learned from all runs but one and asked of that one. Changes are looked for where two
runs on different ground, driven alike, are joined; an alarm inside a run is called false, though
snow is not the same everywhere.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import borealtc
import numpy as np
from numpy.typing import NDArray

from slopewise import read_model
from slopewise.models.terrain.adaptation import classes_of
from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.classifier import NONE, TerrainClassifier
from slopewise.models.terrain.estimator import DriveSample
from slopewise.models.terrain.monitor import (
    Classified,
    GroundChange,
    MonitorSettings,
    TerrainMonitor,
)
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.settings import EstimatorSettings, FilterSettings
from slopewise.models.terrain.windows import Condition, summarise

Floats = NDArray[np.float64]

SETTINGS = EstimatorSettings(filter=FilterSettings(yaw_rate_std=0.1))  # vibration of this vehicle
_MODEL = Path(__file__).with_name("borealtc.toml")
_SAMPLE = (
    "t",
    "v_left",
    "v_right",
    "yaw_rate",
    "current_left",
    "current_right",
    "pitch",
    "roll",
)
_RATES = ("roll_rate", "pitch_rate")
_SECOND = 100  # samples
_BEFORE, _AFTER, _FOUND_WITHIN = 20, 8, 5.0  # [s]


@dataclass(frozen=True)
class Run:
    """One run: name, terrain, samples, and what the monitor said of it."""

    name: str
    terrain: str
    rows: list[tuple[Any, ...]]
    events: list[Classified | GroundChange]

    @property
    def stretches(self) -> list[Classified]:
        """Stretches that tell something of the ground."""
        return [
            e
            for e in self.events
            if isinstance(e, Classified) and e.observation.phase is not Phase.STUCK
        ]


def monitor() -> TerrainMonitor:
    """A fresh one, which knows no class."""
    classes = TerrainClasses(name="none")
    return TerrainMonitor(read_model(_MODEL), classes, MonitorSettings(SETTINGS, rates=len(_RATES)))


def drive(rows: Iterable[tuple[Any, ...]]) -> list[Classified | GroundChange]:
    """Send samples through a fresh monitor."""
    fresh = monitor()
    found: list[Classified | GroundChange] = []
    for row in rows:
        found += fresh.update(DriveSample(*row[:8]), *row[8:])
    return [*found, *fresh.finish()]


def load(folder: Path) -> list[Run]:
    """All runs."""
    runs = []
    for name, terrain, wheels, inertial in borealtc.runs(folder):
        columns = borealtc.read_run(name, terrain, wheels, inertial)
        samples = (np.asarray(columns[key]).tolist() for key in _SAMPLE)
        rates = zip(*(np.asarray(columns[key]).tolist() for key in _RATES), strict=True)
        rows = [(*row, True, r) for row, r in zip(zip(*samples, strict=True), rates, strict=True)]
        runs.append(Run(name, terrain, rows, drive(rows)))
    return runs


def leave_one_run_out(runs: list[Run]) -> tuple[NDArray[np.int64], list[str]]:
    """Confusion of stretches (terrain, answer), each told by classes that have not seen its run."""
    names = list(dict.fromkeys(run.terrain for run in runs))
    confusion = np.zeros((len(names), len(names) + 1), np.int64)
    values = [[e.observation.known.values for e in run.stretches] for run in runs]
    for out, run in enumerate(runs):
        if not values[out]:
            continue
        others = [i for i in range(len(runs)) if i != out]
        labels = [runs[i].terrain for i in others for _ in values[i]]
        classes = classes_of("others", labels, np.array([v for i in others for v in values[i]]))
        stds = np.array([e.observation.known.stds for e in run.stretches])
        table = TerrainClassifier(classes).probabilities(np.array(values[out]), stds)
        found = [*(one.name for one in classes.terrain), NONE]
        for answer in table.argmax(axis=1):
            told = found[int(answer)]
            column = names.index(told) if told in names else len(names)
            confusion[names.index(run.terrain), column] += 1
    return confusion, names


def seconds_alike(run: Run) -> dict[Condition, list[int]]:
    """Seconds of a run, by how they were driven; those that are stuck left out."""
    stuck = [
        (e.observation.begin, e.observation.end)
        for e in run.events
        if isinstance(e, Classified) and e.observation.phase is Phase.STUCK
    ]
    found: dict[Condition, list[int]] = {}
    for second in range(len(run.rows) // _SECOND):
        part = run.rows[second * _SECOND : (second + 1) * _SECOND]
        samples = np.array([(r[1], r[2], r[4], r[5], r[6], r[3], *r[9]) for r in part])
        motion = SETTINGS.motion
        window = summarise(samples, motion.least_inner_speed, motion.turn_end)
        if window is None or any(a < part[-1][0] and part[0][0] < b for a, b in stuck):
            continue
        found.setdefault(window.condition, []).append(second)
    return found


def splices(runs: list[Run], seed: int = 0) -> tuple[dict[tuple[str, str, str], list[bool]], int]:
    """Whether the change was found within 5 s, for each pair of grounds and way of driving.

    Returns:
        Outcomes by (from, to, way of driving), and alarms before the change.
    """
    random = np.random.default_rng(seed)
    alike = [(run, *item) for run in runs for item in seconds_alike(run).items()]
    outcomes: dict[tuple[str, str, str], list[bool]] = {}
    early = 0
    for (a, condition, first), (b, other, second) in itertools.permutations(alike, 2):
        if a.terrain == b.terrain or condition != other:
            continue
        if len(first) < _BEFORE or len(second) < _AFTER:
            continue
        begin = int(random.integers(0, len(first) - _BEFORE + 1))
        end = int(random.integers(0, len(second) - _AFTER + 1))
        rows = _rows(a, first[begin : begin + 2 * _BEFORE])
        joined = len(rows) / _SECOND
        rows += _rows(b, second[end : end + _AFTER])
        timed = [(i / _SECOND, *row[1:]) for i, row in enumerate(rows)]
        alarms = [e.time for e in drive(timed) if isinstance(e, GroundChange)]
        early += sum(t <= joined for t in alarms)
        found = any(joined < t <= joined + _FOUND_WITHIN + 0.02 for t in alarms)
        outcomes.setdefault((a.terrain, b.terrain, condition[0]), []).append(found)
    return outcomes, early


def _rows(run: Run, seconds: list[int]) -> list[tuple[Any, ...]]:
    return [row for s in seconds for row in run.rows[s * _SECOND : (s + 1) * _SECOND]]


def main(folder: Path) -> None:
    """Print everything."""
    runs = load(folder)
    for name in dict.fromkeys(run.terrain for run in runs):
        own = [e.observation.own.values for r in runs if r.terrain == name for e in r.stretches]
        stuck = sum(
            e.observation.end - e.observation.begin
            for r in runs
            for e in r.events
            if r.terrain == name and isinstance(e, Classified) and e not in r.stretches
        )
        texts = []
        for letter, column in zip(("f_r", "μ_t", "B_s"), np.array(own).T, strict=True):
            known = column[np.isfinite(column)]
            low, middle, high = np.quantile(known, (0.16, 0.5, 0.84))
            texts.append(f"{letter} {middle:.3f} [{low:.3f} … {high:.3f}] of {len(known)}")
        print(f"{name:11s} {'  '.join(texts)}  stuck {stuck:.0f} s")
    confusion, names = leave_one_run_out(runs)
    recall = np.diag(confusion) / confusion.sum(axis=1)
    shares = ", ".join(f"{name} {share:.2f}" for name, share in zip(names, recall, strict=True))
    print(f"\nleave one run out: balanced accuracy {recall.mean():.3f}; {shares}")
    print(confusion)
    outcomes, early = splices(runs)
    told = [found for values in outcomes.values() for found in values]
    hard = [f for (a, b, way), v in outcomes.items() for f in v if _hard(a, b, way)]
    rest = [f for (a, b, way), v in outcomes.items() for f in v if not _hard(a, b, way)]
    print(f"\nchanges found within 5 s: {np.mean(told):.2f} of {len(told)}")
    print(f"  asphalt and ice driven straight: {np.mean(hard):.2f} of {len(hard)}; ", end="")
    print(f"all others: {np.mean(rest):.2f} of {len(rest)}; alarms before the change: {early}")
    alarms = [(r.name, e.time) for r in runs for e in r.events if isinstance(e, GroundChange)]
    minutes = sum(len(run.rows) for run in runs) / _SECOND / 60.0
    often = 10 * len(alarms) / minutes
    print(f"alarms inside runs: {len(alarms)} in {minutes:.0f} min, {often:.2f} per 10 min")
    print(" ", ", ".join(f"{name} {t:.0f} s" for name, t in alarms))


def _hard(a: str, b: str, way: str) -> bool:
    """Two hard and smooth grounds that only turning tells apart."""
    return {a, b} == {"asphalt", "ice"} and way == "straight"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
