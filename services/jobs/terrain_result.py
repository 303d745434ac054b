"""Events of drive logs on terrain, and statistics of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slopewise.models.parameters import Model
from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.classifier import NONE
from slopewise.models.terrain.monitor import SURE, Classified, GroundChange
from slopewise.models.terrain.observation import Features
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.reliability import ReliabilityBin, reliability_curve
from slopewise.models.terrain.signature import Signature
from slopewise.models.terrain.signature_model import SignatureModel
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.terrain_file import TerrainFile

_LASTING = 6
"""Stretches of unknown ground from which it is proposed as a class; a stretch lasts about 1 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEvents:
    """Terrain events of one run, in chronological order."""

    run: str
    samples: slice
    events: list[Classified | GroundChange]
    excluded: list[Suspect]
    known: Features  # of the ground at the end of the run
    labels: list[str]  # terrain as the log names it, one per classified stretch
    signatures: list[tuple[Signature, str]]  # with the log's name of the ground
    centres: list[tuple[float, float]]
    """Centres of rotation (left, right) of each stretch [m], NaN where not observable."""
    compared: int
    not_compared: int
    """Steady seconds in which a change would have been detected, and could not be."""

    @property
    def classified(self) -> list[Classified]:
        """Stretches alone."""
        return [event for event in self.events if isinstance(event, Classified)]

    @property
    def changes(self) -> list[GroundChange]:
        """Changes alone."""
        return [event for event in self.events if isinstance(event, GroundChange)]

    @property
    def typical_class(self) -> str:
        """Class of most stretches, empty if no stretch has one."""
        names = [event.answer.name for event in self.classified if event.answer.name]
        return max(dict.fromkeys(names), key=names.count) if names else ""

    @property
    def probabilities(self) -> dict[str, float]:
        """Mean probability of each class over the stretches that have one."""
        answers = [event.answer.probabilities for event in self.classified if event.answer.name]
        names = dict.fromkeys(name for answer in answers for name in answer)
        return {n: float(np.mean([answer.get(n, 0.0) for answer in answers])) for n in names}

    @property
    def stuck_seconds(self) -> float:
        """Duration for which the wheels spun without turning the vehicle [s]."""
        stretches = [event.observation for event in self.classified]
        return sum(o.end - o.begin for o in stretches if o.phase is Phase.STUCK)


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainResult:
    """Events of all runs, and what they were made from."""

    runs: list[RunEvents]
    log: DriveLog
    model: Model
    terrains: TerrainFile
    classes: TerrainClasses  # at the end of the log
    usable_samples: NDArray[np.bool_]  # (samples,), may be learned from
    seconds: float  # without reading
    notes: tuple[str, ...] = ()
    signatures: SignatureModel | None = None  # None: f_r, μ_t and B_s alone classify

    @property
    def known(self) -> Features:
        """Features of the ground at the end of the log, of the last run that has any."""
        for run in reversed(self.runs):
            if np.isfinite(run.known.values).any():
                return run.known
        return Features()

    @property
    def ends_on_known_class(self) -> bool:
        """True if the ground at the end of the log is of a known class with high probability."""
        for run in reversed(self.runs):
            answers = [event.answer for event in run.classified if event.answer.name]
            if answers:
                names = {terrain_class.name for terrain_class in self.classes.terrain}
                if self.signatures is not None:
                    names |= set(self.signatures.classes)
                return answers[-1].name in names and answers[-1].probability >= SURE
        return False

    @property
    def class_values(self) -> dict[str, list[tuple[float, float, float]]]:
        """Features of the stretches by the class they were given, known classes only."""
        names = {terrain_class.name for terrain_class in self.classes.terrain}
        values: dict[str, list[tuple[float, float, float]]] = {}
        for run in self.runs:
            for event in run.classified:
                if event.answer.name in names:
                    values.setdefault(event.answer.name, []).append(event.observation.known.values)
        return values

    @property
    def labelled(self) -> list[tuple[Classified, str]]:
        """Stretches with their labels, "" without one; without those in which it was stuck."""
        return [
            (event, label)
            for run in self.runs
            for event, label in zip(run.classified, run.labels, strict=True)
            if event.observation.phase is not Phase.STUCK
        ]

    @property
    def reliability(self) -> tuple[ReliabilityBin, ...]:
        """Share of correct classes by their probability; empty without labels in the log."""
        answers = [
            (event.answer.probability, event.answer.name == label)
            for run in self.runs
            for event, label in zip(run.classified, run.labels, strict=True)
            if label and event.answer.name
        ]
        probability = np.array([p for p, _ in answers])
        return reliability_curve(probability, np.array([is_right for _, is_right in answers], bool))

    @property
    def unknown_ground(self) -> list[tuple[str, int]]:
        """Runs on ground of no known class for long, each with its number of stretches."""
        runs = []
        for run in self.runs:
            count = sum(event.answer.name == NONE for event in run.classified)
            if count >= _LASTING and run.typical_class == NONE:
                runs.append((run.run, count))
        return runs

    @property
    def agreement(self) -> float | None:
        """Balanced share of stretches whose class is the log's label; None without labels.

        It is higher for classes learned from these labels than on other ground.
        """
        names = [name for name in dict.fromkeys(label for _, label in self.labelled) if name]
        if not names or not self.classes.terrain:
            return None
        shares = [
            np.mean([event.answer.name == name for event, label in self.labelled if label == name])
            for name in names
        ]
        return float(np.mean(shares))
