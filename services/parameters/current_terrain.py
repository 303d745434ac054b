"""Terrain that the robot drives on, by labels from estimators and by its own samples.

A label holds for a few seconds. Own samples give the terrain parameters of Slip and a description,
hard or soft, gripping or slippery or undecided; a change is a description that turned around. They
give no name: plans use the weakest of the surfaces that it does not exclude.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.parameters.parameter_group import TerrainUpdate
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire.arrival import MAX_ROBOT_SENDERS, SenderTable
from slopewise.services.wire.observations import TerrainLabel

_NEEDED = ("yaw_rate", "v_left", "v_right", "current_left", "current_right")
"""Columns that the terrain estimator needs in addition to those of every drive."""

_SAMPLED = ("t", "v_left", "v_right", "yaw_rate", "current_left", "current_right", "pitch", "roll")


@dataclass(slots=True)
class _Run:
    """Terrain estimator of one sender."""

    monitor: Any
    last: float = -np.inf  # time of its newest sample, on the sender's clock [s]


class CurrentTerrain:
    """Follows the terrain under the robot; one thread."""

    def __init__(self, file: Model, settings: Learning) -> None:
        """Begin without labels and samples of the vehicle in a model file."""
        self.unsupported_reason = ""  # why samples are not used; empty while they are used
        self._settings, make_monitor = settings, _monitor_maker(settings.terrains)
        self._label, self._label_until, self._label_probability = "", -np.inf, 0.0
        self._runs = SenderTable[str, _Run](lambda: _Run(make_monitor(file)), MAX_ROBOT_SENDERS)
        self._newest: Any = None  # monitor with the latest samples

    def label(self, label: TerrainLabel, now: float) -> None:
        """Use an estimator's label; an improbable one means unknown terrain."""
        self._label = label.surface if label.probability >= self._settings.sure else ""
        self._label_probability = label.probability
        self._label_until = now + self._settings.label_for

    def surface(self, now: float) -> str:
        """Name of the terrain now by its label, empty where it is unknown."""
        return self._label if now <= self._label_until else ""

    def probability(self, now: float) -> float:
        """Probability of the label now [1]."""
        return self._label_probability if now <= self._label_until else 0.0

    def description(self) -> str:
        """Description of the ground by the latest samples, empty without any."""
        return "" if self._newest is None else str(self._newest.describer.describe())

    def open_surfaces(self) -> tuple[str, ...]:
        """Surfaces that the latest samples do not exclude; none before the first samples."""
        return () if self._newest is None else tuple(self._newest.open_surfaces())

    def flags(self) -> list[str]:
        """Warnings about the samples and the vehicle file."""
        checks = [run.monitor.vehicle_check.message() for run in self._runs.values()]
        return [text for text in (self.unsupported_reason, *dict.fromkeys(checks)) if text]

    def drive(self, source: str, columns: dict[str, Floats]) -> TerrainUpdate:
        """Samples in chronological order; a source that restarts begins another run."""
        if self.unsupported_reason or any(name not in columns for name in _NEEDED):
            return TerrainUpdate()
        try:
            run = self._runs.of(source)
        except ParameterError as error:
            self.unsupported_reason = f"terrain is not estimated: expected {error.expected}"
            return TerrainUpdate()
        if columns["t"][0] <= run.last:
            run.monitor.begin_run()
        run.last, self._newest = float(columns["t"][-1]), run.monitor
        from slopewise.models.terrain.description import GroundChange
        from slopewise.models.terrain.estimator import DriveSample

        changed, features = False, None
        none = np.zeros_like(columns["t"])
        rows = [columns.get(name, none).tolist() for name in _SAMPLED]
        for sample in map(DriveSample, *rows):
            for event in run.monitor.update(sample):
                if isinstance(event, GroundChange):
                    changed = True
                    continue
                known = event.observation.known
                features = tuple(zip(known.values, known.stds, strict=True))
        return TerrainUpdate(changed, features)


def _monitor_maker(terrains: str) -> Callable[[Model], Any]:
    """A maker of terrain estimators with the classes of a terrain file, or without classes."""
    file: Any = None
    if terrains:
        from slopewise.services.io import terrain_file

        file = terrain_file.read_terrains(terrain_file.find_terrains(terrains))

    def make(model: Model) -> Any:
        # Takes half a second to load; a service without such samples never loads it.
        from slopewise.models.terrain.monitor import TerrainMonitor
        from slopewise.services.io.terrain_file import TerrainFile

        known = file or TerrainFile(name=model.name)
        return TerrainMonitor(model, known.classes, known.thresholds, known.estimator)

    return make
