"""What `slopewise terrain` found in a log, and what follows from it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.terrain.adaptation import classes_of
from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.classifier import NONE
from slopewise.models.terrain.monitor import SURE, Classified, GroundChange
from slopewise.models.terrain.observation import Features
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.reliability import ReliabilityBin, reliability_curve
from slopewise.models.terrain.resistances import TerrainEstimate
from slopewise.models.terrain.signature import Signature
from slopewise.models.terrain.signature_fit import fit
from slopewise.models.terrain.signature_model import SignatureModel
from slopewise.models.terrain.surfaces import model_on, with_surface
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.files import fault
from slopewise.services.io.model_file import write_model
from slopewise.services.io.signature_file import write_signatures
from slopewise.services.io.terrain_file import TerrainFile, write_terrains
from slopewise.services.report.plan_labels import plural

_LASTS = 6  # stretches of unknown ground that are offered as a class


@dataclass(frozen=True, slots=True)
class RunEvents:
    """What one run told, in order of time.

    Attributes:
        run: its name. samples: of the log.
        events: stretches with their classes, and changes.
        excluded: stretches that nothing was learned from.
        known: of the ground at its end.
        labels: terrain as the log names it, for each classified stretch.
        centres: of rotation (left, right) [m] of each classified stretch, NaN where not told.
        signatures: of the run, each with the log's name of the ground.
        compared, not_compared: steady seconds that a change was looked for in, and could not be.
    """

    run: str
    samples: slice
    events: list[Classified | GroundChange]
    excluded: list[Suspect]
    known: Features
    labels: list[str]
    signatures: list[tuple[Signature, str]] = field(default_factory=list)
    centres: list[tuple[float, float]] = field(default_factory=list)
    compared: int = 0
    not_compared: int = 0

    @property
    def classified(self) -> list[Classified]:
        """Stretches alone."""
        return [event for event in self.events if isinstance(event, Classified)]

    @property
    def changes(self) -> list[GroundChange]:
        """Changes alone."""
        return [event for event in self.events if isinstance(event, GroundChange)]


@dataclass(frozen=True, slots=True)
class TerrainResult:
    """Events of all runs, and what they were made from.

    Attributes:
        classes: as they are in the end.
        good: (samples,) what may be learned from.
        seconds: computing, without reading.
        notes: what a reader has to know.
        signatures: what told the classes, None where f_r, μ_t and B_s alone did.
    """

    runs: list[RunEvents]
    log: DriveLog
    model: Model
    terrains: TerrainFile
    classes: TerrainClasses
    good: NDArray[np.bool_]
    seconds: float
    notes: list[str] = field(default_factory=list)
    signatures: SignatureModel | None = None

    @property
    def known(self) -> Features:
        """The ground at the end of the log: the last run that told something."""
        for run in reversed(self.runs):
            if np.isfinite(run.known.values).any():
                return run.known
        return Features()


def learned_terrains(result: TerrainResult) -> TerrainFile:
    """Classes learned from the log: from its column terrain if it has one, else adapted ones."""
    labels, rows = labelled(result)
    learned = result.classes
    if any(labels):
        learned = classes_of(result.terrains.name, labels, np.array(rows))
    return dataclasses.replace(result.terrains, terrain=learned.terrain)


def labelled(result: TerrainResult) -> tuple[list[str], list[tuple[float, float, float]]]:
    """Labels of the log, and features, of each stretch but those stuck."""
    labels, rows = [], []
    for one in result.runs:
        for event, label in zip(one.classified, one.labels, strict=True):
            if event.observation.phase is not Phase.STUCK:
                labels.append(label)
                rows.append(event.observation.known.values)
    return labels, rows


def updated_model(result: TerrainResult) -> Model:
    """The model on the ground driven now, with a table of braking for each class met.

    Raises:
        InputError: a class with so little resistance that the brakes would not stop the vehicle.
    """
    valid = ends_on_a_known_class(result)
    model = model_on(result.model, result.known, valid=valid)
    reference = result.model.terrain.motion_resistance
    for name, values in class_values(result).items():
        f_r = np.array(values)[:, 0]
        f_r = f_r[np.isfinite(f_r)]
        if len(f_r) < 2:
            continue
        found = TerrainEstimate(float(np.mean(f_r)), float(np.std(f_r, ddof=1)))
        try:
            model = with_surface(model, name, found, reference)
        except ParameterError as error:
            raise fault(result.model.name, error.field, f"{name}: {error.expected}") from None
    return model


def ends_on_a_known_class(result: TerrainResult) -> bool:
    """Is the ground at the end of the log of a known class, and surely so?"""
    for one in reversed(result.runs):
        answers = [event.answer for event in one.classified if event.answer.name]
        if answers:
            names = {known.name for known in result.classes.terrain}
            if result.signatures is not None:
                names |= set(result.signatures.classes)
            return answers[-1].name in names and answers[-1].probability >= SURE
    return False


def class_values(result: TerrainResult) -> dict[str, list[tuple[float, float, float]]]:
    """Features of the stretches by the class they were given, known classes only."""
    names = {one.name for one in result.classes.terrain}
    found: dict[str, list[tuple[float, float, float]]] = {}
    for one in result.runs:
        for event in one.classified:
            if event.answer.name in names:
                values = found.setdefault(event.answer.name, [])
                values.append(event.observation.known.values)
    return found


def write_updated_model(result: TerrainResult, path: Path) -> None:
    """Write :func:`updated_model`, all or nothing."""
    write_model(updated_model(result), path)


def write_learned(result: TerrainResult, path: Path) -> None:
    """Write :func:`learned_terrains`, and beside it signatures where the log teaches some.

    Why there are none is added to the notes.
    """
    learned = dataclasses.replace(learned_terrains(result), signatures="")
    try:
        model = learned_signatures(result)
    except ParameterError as error:
        result.notes.append(f"no signatures learned: expected {error.expected}")
    else:
        if model is not None:
            beside = path.with_suffix(".signatures.json")
            write_signatures(model, beside)
            learned = dataclasses.replace(learned, signatures=beside.name)
            result.notes.append(
                f"signatures of {plural(len(model.classes), 'class')} in {beside.name}: "
                f"{model.known_refused:.1%} of known ground left out in training was refused"
            )
    write_terrains(learned, path)


def learned_signatures(result: TerrainResult) -> SignatureModel | None:
    """Signatures by the log's column terrain, None if it has none.

    Raises:
        ParameterError: too few runs of a class, or scikit-learn is not installed.
    """
    rows = [
        (signature, label, one.run)
        for one in result.runs
        for signature, label in one.signatures
        if label
    ]
    if not rows:
        return None
    signatures, labels, runs = zip(*rows, strict=True)
    return fit(signatures, labels, runs)


def usual_class(one: RunEvents) -> str:
    """The class of most stretches of a run, empty if none was told."""
    names = [e.answer.name for e in one.classified if e.answer.name]
    return max(dict.fromkeys(names), key=names.count) if names else ""


def probabilities(one: RunEvents) -> dict[str, float]:
    """Mean probability of each class over the stretches of a run that were told one."""
    told = [e.answer.probabilities for e in one.classified if e.answer.name]
    names = dict.fromkeys(name for answer in told for name in answer)
    return {name: float(np.mean([answer.get(name, 0.0) for answer in told])) for name in names}


def reliability(result: TerrainResult) -> tuple[ReliabilityBin, ...]:
    """Shares of right answers beside what was said, by the log's own labels; empty without."""
    told = [
        (event.answer.probability, event.answer.name == label)
        for one in result.runs
        for event, label in zip(one.classified, one.labels, strict=True)
        if label and event.answer.name
    ]
    said, right = np.array([p for p, _ in told]), np.array([r for _, r in told], np.bool_)
    return reliability_curve(said, right)


def unknown_ground(result: TerrainResult) -> list[tuple[str, int]]:
    """(run, stretches) where ground of no known class lasted: offered to be named."""
    found = []
    for one in result.runs:
        many = sum(event.answer.name == NONE for event in one.classified)
        if many >= _LASTS and usual_class(one) == NONE:
            found.append((one.run, many))
    return found


def stuck_seconds(one: RunEvents) -> float:
    """How long the wheels spun without turning the vehicle [s]."""
    stuck = [e.observation for e in one.classified if e.observation.phase is Phase.STUCK]
    return sum(o.end - o.begin for o in stuck)


def agreement(result: TerrainResult) -> float | None:
    """Balanced share of stretches whose class is the log's own label; None without labels.

    Classes learned from these very labels agree better than with ground they were not shown.
    """
    labels, _ = labelled(result)
    told = [
        event.answer.name
        for one in result.runs
        for event in one.classified
        if event.observation.phase is not Phase.STUCK
    ]
    names = [name for name in dict.fromkeys(labels) if name]
    if not names or not result.classes.terrain:
        return None
    shares = [
        np.mean([t == name for t, label in zip(told, labels, strict=True) if label == name])
        for name in names
    ]
    return float(np.mean(shares))
