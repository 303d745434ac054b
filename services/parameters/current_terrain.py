"""Terrain that the robot drives on, by labels from estimators and by its own samples.

A label holds for a few seconds. Own samples give the terrain parameters of Slip and a description,
hard or soft, gripping or slippery or undecided; a change is a description that turned around. They
give no name: plans use the weakest of the surfaces that it does not exclude.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.parameters.parameter_group import TerrainUpdate
from slopewise.services.wire.observations import TerrainLabel

_NEEDED = ("yaw_rate", "v_left", "v_right", "current_left", "current_right")
"""Columns that the terrain estimator needs in addition to those of every drive."""

_SAMPLED = ("t", "v_left", "v_right", "yaw_rate", "current_left", "current_right", "pitch", "roll")

_MAX_SOURCES = 8  # senders with a terrain estimator each [1]; a robot has one or two


@dataclass(slots=True)
class CurrentTerrain:
    """Follows the terrain under the robot; one thread."""

    model: Model  # model of the model file
    monitor: Callable[[Model], Any]  # makes a terrain estimator; loads it with the first samples
    label_for: float  # time that a label holds [s]
    min_probability: float  # smallest probability of an accepted label [1]
    unsupported_reason: str = ""  # why samples are not used; empty while they are used
    _label: str = ""
    _label_until: float = -np.inf
    _label_probability: float = 0.0
    _source: str = ""
    _monitors: OrderedDict[str, Any] = field(default_factory=OrderedDict)
    _last: dict[str, float] = field(default_factory=dict)

    def label(self, label: TerrainLabel, now: float) -> None:
        """Use an estimator's label; an improbable one means unknown terrain."""
        self._label = label.surface if label.probability >= self.min_probability else ""
        self._label_probability = label.probability
        self._label_until = now + self.label_for

    def surface(self, now: float) -> str:
        """Name of the terrain now by its label, empty where it is unknown."""
        return self._label if now <= self._label_until else ""

    def probability(self, now: float) -> float:
        """Probability of the label now [1]."""
        return self._label_probability if now <= self._label_until else 0.0

    def description(self) -> str:
        """Description of the ground by the latest samples, empty without any."""
        monitor = self._monitors.get(self._source)
        return "" if monitor is None else str(monitor.describer.describe())

    def open_surfaces(self) -> tuple[str, ...]:
        """Surfaces that the latest samples do not exclude; none before the first samples."""
        monitor = self._monitors.get(self._source)
        return () if monitor is None else tuple(monitor.open_surfaces())

    def flags(self) -> list[str]:
        """Warnings about the samples and the vehicle file."""
        checks = [monitor.vehicle_check.message() for monitor in self._monitors.values()]
        return [text for text in (self.unsupported_reason, *dict.fromkeys(checks)) if text]

    def drive(self, source: str, columns: dict[str, Floats]) -> TerrainUpdate:
        """Samples in chronological order; a source that restarts begins another run."""
        if self.unsupported_reason or any(name not in columns for name in _NEEDED):
            return TerrainUpdate()
        monitor = self._monitor(source, float(columns["t"][0]))
        if monitor is None:
            return TerrainUpdate()
        from slopewise.models.terrain.description import GroundChange
        from slopewise.models.terrain.estimator import DriveSample

        self._last[source], self._source = float(columns["t"][-1]), source
        changed, features = False, None
        none = np.zeros_like(columns["t"])
        rows = [columns.get(name, none).tolist() for name in _SAMPLED]
        for sample in map(DriveSample, *rows):
            for event in monitor.update(sample):
                if isinstance(event, GroundChange):
                    changed = True
                    continue
                known = event.observation.known
                features = tuple(zip(known.values, known.stds, strict=True))
        return TerrainUpdate(changed, features)

    def _monitor(self, source: str, begin: float) -> Any:
        monitor = self._monitors.pop(source, None)
        if monitor is None:
            try:
                monitor = self.monitor(self.model)
            except ParameterError as error:
                self.unsupported_reason = f"terrain is not estimated: expected {error.expected}"
                return None
        elif begin <= self._last[source]:
            monitor.begin_run()
        self._monitors[source] = monitor
        while len(self._monitors) > _MAX_SOURCES:
            oldest, _ = self._monitors.popitem(last=False)
            self._last.pop(oldest, None)
        return monitor


def monitor_maker(terrains: str) -> Callable[[Model], Any]:
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
