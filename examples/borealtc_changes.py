"""Changes of ground on BorealTC: joined runs of unlike ground, and alarms within single runs.

    python examples/borealtc_changes.py path/to/borealtc [--seed 0]

For each ordered pair of classes three pairs of runs are drawn. Up to a minute of the first, from
where it drives, is joined to up to half a minute of the second as they were driven; signatures are
those of a model of all other runs. A change counts as found if it is told within 5 s of the joint.
It is called distinguished where both runs were driven alike for at least 5 s and some channel of
that second-by-second comparison lies twice its own spread apart. Alarms inside single runs are
called false, though snow is not the same everywhere; those within ten seconds of another count with
it.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path
from typing import NamedTuple

import borealtc
import numpy as np
from borealtc_figures import SETTINGS
from borealtc_unseen import CHANNELS, Run, load, model_of
from numpy.typing import NDArray

from slopewise import read_model
from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.estimator import DriveSample
from slopewise.models.terrain.monitor import GroundChange, MonitorSettings, TerrainMonitor
from slopewise.models.terrain.signature_model import SignatureModel
from slopewise.models.terrain.windows import Condition, SteadySecond, summarise

Floats = NDArray[np.float64]

_MODEL = Path(__file__).with_name("borealtc.toml")
_COLUMNS = (*CHANNELS[:2], "yaw_rate", *CHANNELS[2:4], "pitch", "roll", *CHANNELS[6:])
_RATE, _BEFORE, _AFTER, _WITHIN, _EACH = 100, 60, 30, 5.0, 3


class Outcome(NamedTuple):
    """One joined pair: was the change told in time, and could it be."""

    first: str
    second: str
    found: bool
    distinguished: bool


def samples_of(folder: Path) -> dict[str, Floats]:
    """(n, 12) samples of each run by name, from its first driven second on."""
    found = {}
    for name, terrain, wheels, inertial in borealtc.runs(folder):
        columns = borealtc.read_run(name, terrain, wheels, inertial)
        samples = np.column_stack([np.asarray(columns[key]) for key in _COLUMNS])
        driven = np.flatnonzero(np.abs(samples[:, :2]).max(axis=1) > 0.03)
        if len(driven):
            found[name] = samples[driven[0] :]
    return found


def changes(samples: Floats, model: SignatureModel | None) -> list[GroundChange]:
    """Changes that a fresh monitor tells in (n, 12) samples at 100 Hz."""
    monitor = TerrainMonitor(
        read_model(_MODEL),
        TerrainClasses(name="none"),
        MonitorSettings(SETTINGS, rates=2),
        signatures=model,
    )
    events = []
    for i, row in enumerate(samples.tolist()):
        sample = DriveSample(i / _RATE, *row[:7])
        events += monitor.update(sample, True, (row[7], row[8]), tuple(row[9:]))
    return [e for e in (*events, *monitor.finish()) if isinstance(e, GroundChange)]


def steady_seconds(samples: Floats) -> dict[Condition, list[SteadySecond]]:
    """Second-by-second summaries, by the way of driving."""
    found: dict[Condition, list[SteadySecond]] = {}
    order = [0, 1, 3, 4, 5, 2, 7, 8]
    for part in np.split(samples, range(_RATE, len(samples), _RATE)):
        motion = SETTINGS.motion
        window = summarise(part[:, order], motion.least_inner_speed, motion.turn_end)
        if window is not None and len(part) == _RATE:
            found.setdefault(window.condition, []).append(window)
    return found


def distinguished(first: Floats, second: Floats) -> bool:
    """Does some channel tell two recordings apart, driven alike?"""
    a, b = steady_seconds(first), steady_seconds(second)
    for condition in a.keys() & b.keys():
        x, y = (np.array([w.channels for w in part[condition]]) for part in (a, b))
        if min(len(x), len(y)) < _WITHIN:
            continue
        spread = np.sqrt(0.5 * (x.var(axis=0) + y.var(axis=0))) + 1e-6
        if np.any(np.abs(x.mean(axis=0) - y.mean(axis=0)) > 2.0 * spread):
            return True
    return False


def joined(runs: list[Run], samples: dict[str, Floats], seed: int) -> list[Outcome]:
    """All ordered pairs of classes, some pairs of runs each."""
    random = np.random.default_rng(seed)
    classes = list(dict.fromkeys(run.terrain for run in runs))
    outcomes = []
    for a, b in itertools.permutations(classes, 2):
        own = [[r.name for r in runs if r.terrain == name] for name in (a, b)]
        for one, two in zip(*(random.permutation(names)[:_EACH] for names in own), strict=True):
            first = samples[one][: _BEFORE * _RATE]
            second = samples[two][: _AFTER * _RATE]
            model = model_of([run for run in runs if run.name not in (one, two)])
            told = changes(np.vstack([first, second]), model)
            joint = len(first) / _RATE
            found = any(joint < e.time <= joint + _WITHIN + 0.02 for e in told)
            outcome = Outcome(str(one), str(two), found, distinguished(first, second))
            late = ", ".join(f"{e.time - joint:.0f}" for e in told)
            print(
                f"  {one} to {two}: {'found' if found else 'not found'} "
                f"({'distinguished' if outcome.distinguished else 'alike'}; told at {late})",
                flush=True,
            )
            outcomes.append(outcome)
    return outcomes


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    runs, samples = load(options.folder), samples_of(options.folder)
    outcomes = joined(runs, samples, options.seed)
    can = [o.found for o in outcomes if o.distinguished]
    print(
        f"changes found within {_WITHIN:.0f} s: {np.mean([o.found for o in outcomes]):.2f} of "
        f"{len(outcomes)}; distinguished ones {np.mean(can):.2f} of {len(can)}"
    )
    alarms, by_class, minutes = 0, 0, 0.0
    for run in runs:
        told = changes(samples[run.name], model_of([r for r in runs if r is not run]))
        told = [e for e in told if not e.again]
        alarms += len(told)
        by_class += sum(e.classes is not None for e in told)
        minutes += len(samples[run.name]) / _RATE / 60.0
    print(
        f"alarms inside runs: {alarms} in {minutes:.0f} min, {10 * alarms / minutes:.2f} in "
        f"10 min; {by_class} of them told by classes"
    )


if __name__ == "__main__":
    main()
