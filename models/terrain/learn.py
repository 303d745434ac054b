"""Classes and thresholds of a vehicle from runs on ground with known names."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from slopewise.models.terrain.agreement import MIN_DAYS
from slopewise.models.terrain.classes import FeatureOfClass, TerrainClass, TerrainClasses
from slopewise.models.terrain.description import ThresholdSettings
from slopewise.models.terrain.evidence import evidence_of
from slopewise.models.terrain.observation import GroundObservation

_FEATURES = {"motion_resistance": "motion", "lateral_resistance": "lateral", "slip_track": "slip"}
_SPREAD = {"motion": 0.17, "lateral": 0.13, "slip": 0.08}
"""Scatter of a logarithm from run to run [1], assumed for a class of one run: that of BorealTC."""


@dataclass(frozen=True, slots=True)
class LabelledRun:
    """Stretches of one run on one named ground; ``session``: day or site, "" without a name."""

    name: str
    session: str
    observations: tuple[GroundObservation, ...]


def classes_of(name: str, runs: Iterable[LabelledRun]) -> TerrainClasses:
    """Classes of runs by their names; f_r at the reference speed of :mod:`.evidence`.

    Spreads are those of runs, or, with three days or sites, of days: they differ by more.
    """
    by_name: dict[str, list[LabelledRun]] = {}
    for run in runs:
        by_name.setdefault(run.name, []).append(run)
    terrain = tuple(_class_of(label, labelled) for label, labelled in by_name.items())
    return TerrainClasses(name=name, terrain=terrain)


def _class_of(name: str, runs: list[LabelledRun]) -> TerrainClass:
    days = len({run.session for run in runs})
    by_unit: dict[object, list[LabelledRun]] = {}
    for index, run in enumerate(runs):
        by_unit.setdefault(run.session if days >= MIN_DAYS else index, []).append(run)
    means = [_means(unit) for unit in by_unit.values()]
    features = {
        key: _feature([m[quantity] for m in means if quantity in m], _SPREAD[quantity])
        for key, quantity in _FEATURES.items()
    }
    return TerrainClass(name=name, days=float(days), **features)


def _means(runs: list[LabelledRun]) -> dict[str, float]:
    """Mean logarithm of each quantity that was measured."""
    logs: dict[str, list[float]] = {}
    for observation in (o for run in runs for o in run.observations):
        for evidence in evidence_of(observation):
            logs.setdefault(evidence.quantity, []).append(evidence.log)
    return {quantity: float(np.mean(values)) for quantity, values in logs.items()}


def _feature(logs: list[float], spread: float) -> FeatureOfClass | None:
    if not logs:
        return None
    mean = math.exp(float(np.mean(logs)))
    # values that agree to the last digit are copies, not certainty
    std = spread if len(logs) < 2 else max(float(np.std(logs, ddof=1)), 0.01)
    return FeatureOfClass(mean=mean, std=std * mean, samples=max(len(logs), 2))


def thresholds_of(
    classes: TerrainClasses, lever: float, settings: ThresholdSettings
) -> ThresholdSettings:
    """Settings with thresholds midway in the widest gap between neighbouring classes.

    ``lever``: track width over wheelbase [1]. A gap within two scatters of runs separates nothing.
    """
    f_r, turning = [], []
    for terrain in classes.terrain:
        motion, lateral = terrain.motion_resistance, terrain.lateral_resistance
        if motion is not None and motion.mean > 0.0:
            f_r.append(math.log(motion.mean))
            if lateral is not None and lateral.mean > 0.0:
                turning.append(math.log(lateral.mean + lever * motion.mean))
    return dataclasses.replace(
        settings,
        soft_above=_midway(f_r, settings.motion_run_std),
        slippery_below=_midway(turning, settings.turning_run_std),
    )


def _midway(logs: list[float], run_std: float) -> float | None:
    gaps = [(high - low, 0.5 * (low + high)) for low, high in pairwise(sorted(logs))]
    width, middle = max(gaps, default=(0.0, 0.0))
    return math.exp(middle) if width > 2.0 * run_std else None
