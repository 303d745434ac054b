"""Terrain on BorealTC: parameters, the two words, classes and changes, on held-out runs.

    python examples/borealtc_figures.py path/to/borealtc

Classes and thresholds are learned without a quarter of each class's runs, or without a class, and
asked for these. Changes are runs of unlike ground joined; a change inside one run counts as false,
though snow is not the same everywhere.
"""

from __future__ import annotations

import itertools
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import borealtc
import numpy as np

from slopewise import Model, read_model
from slopewise.models.terrain.agreement import ALPHA, agreement
from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.description import (
    UNDECIDED,
    GroundChange,
    GroundDescriber,
    GroundDescription,
    ThresholdSettings,
)
from slopewise.models.terrain.estimator import DriveSample, TerrainEstimator
from slopewise.models.terrain.learn import LabelledRun, classes_of, thresholds_of
from slopewise.models.terrain.observation import GroundObservation, TerrainEstimate
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.settings import EstimatorSettings, FilterSettings

SETTINGS = EstimatorSettings(filter=FilterSettings(yaw_rate_std=0.1))  # vibration of this vehicle
MODEL = read_model(Path(__file__).with_name("borealtc.toml"))
TRUTH = {
    "asphalt": ("hard", "gripping"),
    "ice": ("hard", "slippery"),
    "sandy_loam": ("soft", "gripping"),
    "snow": ("soft", "gripping"),
}
_LEVER = MODEL.vehicle.track_width / MODEL.vehicle.wheelbase
_SAMPLE = ("t", "v_left", "v_right", "yaw_rate", "current_left", "current_right", "pitch", "roll")
_WINDOW, _BEFORE, _AFTER, _BLOCKS = 12.0, 60.0, 30.0, 4  # [s], [s], [s], [1]


@dataclass(frozen=True)
class Run:
    """One run: name, terrain, its stretches with time from its start, and its duration [s]."""

    name: str
    terrain: str
    observations: tuple[GroundObservation, ...]
    seconds: float

    @property
    def ground(self) -> list[GroundObservation]:
        """Stretches that were not stuck."""
        return [o for o in self.observations if o.phase is not Phase.STUCK]


def observe(columns: borealtc.Columns, model: Model = MODEL) -> list[GroundObservation]:
    """Stretches of a run."""
    f_r = TerrainEstimate(model.terrain.motion_resistance, 0.1)
    track = model.terrain.slip_track
    estimator = TerrainEstimator(
        model.vehicle, slip_track=track, motion_resistance=f_r, settings=SETTINGS
    )
    rows = zip(*(np.asarray(columns[key]).tolist() for key in _SAMPLE), strict=True)
    stretches = [estimator.update(DriveSample(*row)) for row in rows]
    return [o for o in (*stretches, estimator.finish()) if o is not None]


def load(folder: Path) -> list[Run]:
    """All runs."""
    runs = []
    for item in borealtc.runs(folder):
        columns = borealtc.read_run(*item)
        time = np.asarray(columns["t"], float)
        moved = tuple(moved_by(o, -float(time[0])) for o in observe(columns))
        runs.append(Run(item[0], item[1], moved, float(time[-1] - time[0])))
    return runs


def moved_by(observation: GroundObservation, seconds: float) -> GroundObservation:
    """The same stretch at another time."""
    return replace(observation, begin=observation.begin + seconds, end=observation.end + seconds)


def learn(runs: Sequence[Run]) -> tuple[TerrainClasses, ThresholdSettings]:
    """Classes and thresholds of runs."""
    labelled = [LabelledRun(run.terrain, "", tuple(run.ground)) for run in runs]
    classes = classes_of("borealtc", labelled)
    return classes, thresholds_of(classes, _LEVER, ThresholdSettings())


def windows(
    run: Run, classes: TerrainClasses, thresholds: ThresholdSettings
) -> list[tuple[GroundDescription, frozenset[str]]]:
    """Description and agreeing classes at the end of each window of twelve seconds."""
    by_window: dict[int, list[GroundObservation]] = {}
    for o in run.ground:
        by_window.setdefault(int(0.5 * (o.begin + o.end) // _WINDOW), []).append(o)
    answers = []
    for observations in by_window.values():
        describer = GroundDescriber(thresholds)
        for o in observations:
            describer.add(o)
        p_values = agreement(classes, describer.window)
        agreeing = frozenset(name for name, p_value in p_values.items() if p_value > ALPHA)
        answers.append((describer.describe(), agreeing))
    return answers


def held_out(runs: Sequence[Run], *, by_class: bool) -> dict[str, Counter[str]]:
    """Counts by terrain of windows, statements, wrong ones, single classes and wrong ones."""
    splits: list[set[str]] = []
    names = dict.fromkeys(run.terrain for run in runs)
    if by_class:
        splits = [{run.name for run in runs if run.terrain == name} for name in names]
    else:
        for block in range(_BLOCKS):
            parts = [[r.name for r in runs if r.terrain == name] for name in names]
            chosen = [np.array_split(part, _BLOCKS)[block] for part in parts]
            splits.append({str(name) for part in chosen for name in part})
    counts: dict[str, Counter[str]] = {name: Counter() for name in names}
    for split in splits:
        classes, thresholds = learn([run for run in runs if run.name not in split])
        for run in (run for run in runs if run.name in split):
            for described, agrees in windows(run, classes, thresholds):
                counts[run.terrain] += _outcome(run.terrain, described, agrees)
    return counts


def _outcome(terrain: str, described: GroundDescription, agrees: frozenset[str]) -> Counter[str]:
    count: Counter[str] = Counter()
    axes = (
        ("hardness", described.hardness, described.hardness_score),
        ("grip", described.grip, described.grip_score),
    )
    for (axis, text, score), truth in zip(axes, TRUTH[terrain], strict=True):
        count[f"{axis} windows"] += int(np.isfinite(score))
        count[f"{axis} stated"] += text != UNDECIDED
        count[f"{axis} wrong"] += text not in (UNDECIDED, truth)
    count["windows"] += 1
    count["agrees"] += terrain in agrees
    count["single"] += len(agrees) == 1
    count["single wrong"] += len(agrees) == 1 and terrain not in agrees
    return count


def changes_in(
    observations: Sequence[GroundObservation], thresholds: ThresholdSettings
) -> list[GroundChange]:
    """Changes along stretches."""
    describer = GroundDescriber(thresholds)
    return [change for o in observations for change in describer.add(o)]


def joined(runs: Sequence[Run], *, seed: int = 0, pairs: int = 9) -> dict[tuple[str, str], float]:
    """Share of changes found by ordered pair of classes that alters a word; runs are held out."""
    random = np.random.default_rng(seed)
    shares = {}
    for a, b in itertools.permutations(dict.fromkeys(run.terrain for run in runs), 2):
        if TRUTH[a] == TRUTH[b]:
            continue
        first = random.choice([r for r in runs if r.terrain == a], pairs)
        second = random.choice([r for r in runs if r.terrain == b], pairs)
        count = 0
        for before, after in zip(first, second, strict=True):
            _, thresholds = learn([run for run in runs if run not in (before, after)])
            joint = min(before.seconds, _BEFORE)
            head = [o for o in before.ground if o.end <= joint]
            tail = [moved_by(o, joint) for o in after.ground if o.end <= _AFTER]
            changes = changes_in([*head, *tail], thresholds)
            count += any(c.time > joint and c.now in TRUTH[b] for c in changes)
        shares[a, b] = count / pairs
    return shares


def false_changes(runs: Sequence[Run]) -> tuple[int, float]:
    """Changes inside single runs, and minutes driven."""
    count = 0
    for run in runs:
        _, thresholds = learn([r for r in runs if r is not run])
        count += len(changes_in(run.ground, thresholds))
    return count, sum(run.seconds for run in runs) / 60.0


def coverage(runs: Sequence[Run]) -> dict[str, tuple[float, int]]:
    """Share of 95 % intervals of single stretches that hold the median of their run's other half.

    Values are f_r, μ_t and B_s; with the number of intervals.
    """
    inside: dict[str, list[bool]] = {}
    for run in runs:
        for name in ("motion_resistance", "lateral_resistance", "slip_track"):
            known = [e for o in run.ground if (e := getattr(o.measured, name)).is_known]
            half = len(known) // 2
            if half < 2:
                continue
            for part, rest in ((known[:half], known[half:]), (known[half:], known[:half])):
                middle = float(np.median([e.value for e in rest]))
                inside.setdefault(name, []).extend(
                    e.interval[0] <= middle <= e.interval[1] for e in part
                )
    return {name: (float(np.mean(flags)), len(flags)) for name, flags in inside.items()}


def main(folder: str) -> None:
    """Print everything."""
    runs = load(Path(folder))
    for name in dict.fromkeys(run.terrain for run in runs):
        values = [o.measured.values for run in runs if run.terrain == name for o in run.ground]
        print(name, "median f_r, μ_t, B_s:", np.round(np.nanmedian(np.array(values), axis=0), 3))
    for name, (share, count) in coverage(runs).items():
        print(f"95 % intervals of {name} hold: {share:.3f} of {count}")
    for text, by_class in (("runs", False), ("class", True)):
        for name, c in held_out(runs, by_class=by_class).items():
            parts = [
                f"{axis}: {c[f'{axis} stated']} of {c[f'{axis} windows']}, "
                f"{c[f'{axis} wrong']} wrong"
                for axis in ("hardness", "grip")
            ]
            print(
                f"{text} held out, {name}: {'; '.join(parts)}; agrees {c['agrees']} of "
                f"{c['windows']}, single {c['single']}, {c['single wrong']} wrong"
            )
    shares = joined(runs)
    for (a, b), share in shares.items():
        print(f"  {a} to {b}: {share:.2f}")
    print(f"changes found: {np.mean(list(shares.values())):.2f}")
    count, minutes = false_changes(runs)
    print(f"false changes: {count} in {minutes:.0f} min, {10 * count / minutes:.2f} in 10 min")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
