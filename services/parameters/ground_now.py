"""What the robot drives on just now, by labels from estimators and by its own samples.

A label holds for a few seconds. Own samples give the terrain parameters of Slip and, with known
classes, a class; a detector notices that the ground changed, whatever it is.
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
from slopewise.services.parameters.group import GroundNews
from slopewise.services.wire.observations import TerrainLabel

NEEDED = ("yaw_rate", "v_left", "v_right", "current_left", "current_right")
"""Columns beside those of every drive that the terrain estimator needs."""

_MOST_SOURCES = 8


@dataclass(slots=True)
class GroundNow:
    """Follows the ground under the robot; one thread.

    Attributes:
        model: as in the model file.
        monitor: makes a terrain estimator of a model; loads it with the first samples.
        label_for: how long a label holds [s]. sure: probability from which on it is believed.
        unable: why samples tell nothing about the ground, empty as long as they do.
    """

    model: Model
    monitor: Callable[[Model], Any]
    label_for: float
    sure: float
    unable: str = ""
    _label: str = ""
    _label_until: float = -np.inf
    _own: str = ""
    _label_probability: float = 0.0
    _own_probability: float = 0.0
    _monitors: OrderedDict[str, Any] = field(default_factory=OrderedDict)
    _last: dict[str, float] = field(default_factory=dict)

    def label(self, label: TerrainLabel, now: float) -> None:
        """What an estimator takes the ground to be; an unsure one knows nothing."""
        self._label = label.surface if label.probability >= self.sure else ""
        self._label_probability = label.probability
        self._label_until = now + self.label_for

    def surface(self, now: float) -> str:
        """Name of the ground now, empty where nobody is sure."""
        return self._label if now <= self._label_until else self._own

    def told(self, now: float) -> tuple[str, float]:
        """Name of the ground now, and how probable it is."""
        labelled = now <= self._label_until
        return self.surface(now), self._label_probability if labelled else self._own_probability

    def drive(self, source: str, columns: dict[str, Floats]) -> GroundNews:
        """Samples in the order of time; a source that begins anew begins another run."""
        if self.unable or any(name not in columns for name in NEEDED):
            return GroundNews()
        monitor = self._monitor(source, float(columns["t"][0]))
        if monitor is None:
            return GroundNews()
        from slopewise.models.terrain.classifier import NONE
        from slopewise.models.terrain.estimator import DriveSample
        from slopewise.models.terrain.monitor import GroundChange

        self._last[source] = float(columns["t"][-1])
        changed, features = False, None
        names = ("t", "v_left", "v_right", "yaw_rate", "current_left", "current_right", "pitch")
        roll = columns.get("roll")
        rows = [columns[name].tolist() for name in names]
        rows.append(np.zeros(len(rows[0])).tolist() if roll is None else roll.tolist())
        for sample in map(DriveSample, *rows):
            for event in monitor.update(sample):
                if isinstance(event, GroundChange):
                    changed, self._own = True, ""
                    continue
                answer = event.answer
                self._own_probability = float(np.nan_to_num(answer.probability))
                if answer.name not in ("", NONE):
                    self._own = answer.name if answer.probability >= self.sure else ""
                elif answer.name == NONE:
                    self._own = ""
                known = event.observation.known
                features = tuple(zip(known.values, known.stds, strict=True))
        return GroundNews(changed, features, valid=bool(self._own))

    def _monitor(self, source: str, begin: float) -> Any:
        monitor = self._monitors.pop(source, None)
        if monitor is None:
            try:
                monitor = self.monitor(self.model)
            except ParameterError as error:
                self.unable = f"terrain is not estimated: expected {error.expected}"
                return None
        elif begin <= self._last[source]:
            monitor.begin_run()
        self._monitors[source] = monitor
        while len(self._monitors) > _MOST_SOURCES:
            gone, _ = self._monitors.popitem(last=False)
            self._last.pop(gone, None)
        return monitor


def monitor_maker(terrains: str) -> Callable[[Model], Any]:
    """A maker of terrain estimators with the classes of a terrain file, or with none.

    Raises:
        InputError: there is no such file, or it cannot be used.
    """
    file: Any = None
    signatures: Any = None
    if terrains:
        from slopewise.services.io.terrain_file import (
            find_terrains,
            read_signatures_of,
            read_terrains,
        )

        path = find_terrains(terrains)
        file = read_terrains(path)
        signatures = read_signatures_of(file, path)

    def make(model: Model) -> Any:
        # Takes half a second to load; a service that gets no such samples does without.
        from slopewise.models.terrain.monitor import MonitorSettings, TerrainMonitor
        from slopewise.services.io.terrain_file import TerrainFile

        known = file or TerrainFile(name=model.name)
        settings = MonitorSettings(known.estimator, known.classifier, known.change, known.memory)
        return TerrainMonitor(model, known.classes, settings, signatures=signatures)

    return make
