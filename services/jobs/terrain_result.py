"""Events of drive logs on terrain, and statistics of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slopewise.models.parameters import Model
from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.terrain.description import UNDECIDED, GroundChange
from slopewise.models.terrain.learn import LabelledRun
from slopewise.models.terrain.monitor import DescribedStretch
from slopewise.models.terrain.observation import Features
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.terrain_file import TerrainFile

_LASTING = 6
"""Stretches that agree with no class from which a run is reported as such; one lasts about 1 s."""


@dataclass(frozen=True, slots=True)
class LoggedStretch(DescribedStretch):
    """A stretch with the log's own columns on its ground."""

    label: str  # name of the ground, empty where the log has none
    session: str  # day or site likewise
    centres: tuple[float, float]  # of rotation, left and right [m], NaN where not observable


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEvents:
    """Terrain events of one run, in chronological order."""

    run: str
    samples: slice
    stretches: list[LoggedStretch]
    changes: list[GroundChange]
    excluded: list[Suspect]
    known: Features  # of the ground at the end of the run
    is_relied_on: bool  # the description at the end is as certain as plans rely on

    @property
    def ground(self) -> list[LoggedStretch]:
        """Stretches that were not stuck."""
        return [stretch for stretch in self.stretches if not stretch.is_stuck]

    @property
    def name(self) -> str:
        """Class that most stretches with a single name have, empty without any."""
        return _mode([stretch.name for stretch in self.ground if stretch.name])

    @property
    def hardness(self) -> str:
        """Most frequent statement on hardness."""
        return _stated([stretch.description.hardness for stretch in self.ground])

    @property
    def grip(self) -> str:
        """Most frequent statement on grip."""
        return _stated([stretch.description.grip for stretch in self.ground])

    @property
    def agrees_with(self) -> tuple[str, ...]:
        """Classes that agree with at least half of the stretches."""
        counts = Counter(name for stretch in self.ground for name in stretch.agrees_with)
        return tuple(name for name, count in counts.items() if 2 * count >= len(self.ground))

    @property
    def stuck_seconds(self) -> float:
        """Duration for which the wheels spun without turning the vehicle [s]."""
        stuck = [s.observation for s in self.stretches if s.is_stuck]
        return sum(o.end - o.begin for o in stuck)


def _mode(texts: list[str]) -> str:
    return max(dict.fromkeys(texts), key=texts.count) if texts else ""


def _stated(texts: list[str]) -> str:
    return _mode([text for text in texts if text != UNDECIDED]) or UNDECIDED


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainResult:
    """Events of all runs, and their inputs."""

    runs: list[RunEvents]
    log: DriveLog
    model: Model
    terrains: TerrainFile
    usable_samples: NDArray[np.bool_]  # (samples,), may be learned from
    seconds: float  # without reading
    notes: tuple[str, ...] = ()

    @property
    def known(self) -> Features:
        """Features of the ground at the end of the log, of the last run that has any."""
        for run in reversed(self.runs):
            if np.isfinite(run.known.values).any():
                return run.known
        return Features()

    @property
    def is_relied_on(self) -> bool:
        """True if the last run on ground ends with a description that plans rely on."""
        return next((run.is_relied_on for run in reversed(self.runs) if run.ground), False)

    @property
    def ground(self) -> list[tuple[str, LoggedStretch]]:
        """Run and stretch, of all runs; without those that were stuck."""
        return [(run.run, stretch) for run in self.runs for stretch in run.ground]

    @property
    def labelled(self) -> list[LabelledRun]:
        """Stretches by run and the log's own name of the ground."""
        parts: dict[tuple[str, str, str], list[DescribedStretch]] = {}
        for run, s in self.ground:
            if s.label:
                parts.setdefault((run, s.label, s.session), []).append(s)
        return [
            LabelledRun(label, session, tuple(stretch.observation for stretch in stretches))
            for (_, label, session), stretches in parts.items()
        ]

    @property
    def values_by_name(self) -> dict[str, list[tuple[float, float, float]]]:
        """Features of the stretches by the log's name of their ground, else a single class name."""
        values: dict[str, list[tuple[float, float, float]]] = {}
        for _, stretch in self.ground:
            if name := stretch.label or stretch.name:
                values.setdefault(name, []).append(stretch.observation.known.values)
        return values

    @property
    def unknown_ground(self) -> list[tuple[str, int]]:
        """Runs on ground that mostly agrees with no class, each with the number of stretches."""
        runs = []
        for run in self.runs:
            count = sum(bool(s.p_values) and not s.agrees_with for s in run.ground)
            if count >= _LASTING and 2 * count > len(run.ground):
                runs.append((run.run, count))
        return runs

    @property
    def agreement(self) -> float | None:
        """Share of stretches that agree with the class of their label, mean over labels; or None.

        It is higher for classes learned from these labels than on other ground.
        """
        if not self.terrains.terrain:
            return None
        by_label: dict[str, list[bool]] = {}
        for _, stretch in self.ground:
            if label := stretch.label:
                by_label.setdefault(label, []).append(label in stretch.agrees_with)
        return float(np.mean([np.mean(v) for v in by_label.values()])) if by_label else None
