"""Findings: verdict, named effects, axes, closed gap, next stops to drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Effect, Model

CERTAIN = 0.99
"""Probability beyond which nothing is claimed: other causes are always possible [1]."""


class Verdict(Enum):
    """One word for the whole log."""

    NONE = "none"
    PARAMETER_DRIFT = "parameter_drift"
    MISSING_EFFECT = "missing_effect"
    AMBIGUOUS = "ambiguous"
    UNIDENTIFIABLE = "unidentifiable"
    UNKNOWN = "unknown"
    TOO_NOISY = "too_noisy"


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number with its standard deviation and unit."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True, slots=True)
class NamedEffect:
    """One effect that is named.

    Attributes:
        name: of :data:`slopewise.models.effects.registry.LAWS`. parameters: by name.
        confidence: 0 … 1, that this name and not another one of the library is right, and that no
            further effect is missing next to those named.
        alternatives: other names, of explanations that the log does not rule out.
        where: axis and part of it, as text.
    """

    name: str
    parameters: dict[str, Estimate]
    confidence: float
    alternatives: tuple[str, ...] = ()
    where: str = ""


@dataclass(frozen=True, slots=True)
class LikelyExplanation:
    """Names of effects, or none, and axes of causes without one that a log does not rule out.

    Its weight is its probability among all explanations that were tried.
    """

    names: tuple[str, ...]
    axes: tuple[str, ...]
    weight: float


@dataclass(frozen=True, slots=True)
class LocatedAxis:
    """Where on an axis the refitted model still disagrees.

    Attributes:
        axis: its name. low, high: the part in which most of it sits. unit: of both.
        share_of_gap: share of the excess between stops, or within them, that follows this axis.
        p_value: corrected for the number of axes tried.
    """

    axis: str
    low: float
    high: float
    unit: str
    share_of_gap: float
    p_value: float


@dataclass(frozen=True, slots=True)
class Gap:
    """Disagreement on stops held out.

    Attributes:
        metric, unit: measured quantity. before: with the model as configured.
        refit: with the base refitted. after: with the finding. noise_floor: with a perfect model.
        closed: share of `before` above the floor that is gone, None where `before` is less than
            one and a half times the floor. ci95: its interval, None with it.
    """

    metric: str
    unit: str
    before: float
    refit: float
    after: float
    noise_floor: float
    closed: float | None
    ci95: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class PlannedStop:
    """A stop worth driving; None where something does not matter.

    Speed [m/s], grade, heading and roll [rad], yaw rate [rad/s], pause before it [s], place [m].
    """

    speed: float
    grade: float
    heading: float | None = None
    roll: float | None = None
    yaw_rate: float | None = None
    pause: float | None = None
    x: float | None = None
    y: float | None = None


@dataclass(frozen=True, slots=True)
class Experiment:
    """Next stops to drive: as text, stop by stop, and how often all are needed."""

    text: str
    stops: tuple[PlannedStop, ...] = ()
    repeats: int = 0


@dataclass(frozen=True, slots=True)
class StopCost:
    """Cost of the finding in metres, for a stop that is easy to imagine.

    Attributes:
        speed: at the command [m/s]. grade: [rad]; as near to 3 m/s on 10° down as the log goes.
        before: way from the command to rest by the model as configured [m].
        after: the same with the finding, where that brakes worst [m].
    """

    speed: float
    grade: float
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class AxisResidual:
    """An axis that residuals are shown against.

    Attributes:
        name, unit: those of the axis. value: (S, 3) at begin, middle and end of the braking.
        p_value: significance of the residual before.
    """

    name: str
    unit: str
    value: Floats
    p_value: float


@dataclass(frozen=True, slots=True)
class Evidence:
    """Of all stops.

    Attributes:
        axes: the strongest first. before, after: (S, 3) force of the vehicle less that of the
            model at begin, middle and end of the braking, refitted and with what was found, as a
            share of the weight. x, y: (S,) where each stop began [m], None without places.
        distance: (S,) measured [m]; configured, found: (S,) simulated, the same where the model
            stays as configured.
        time, speed: (T,) of the stop that changes most, or is missed most where none does,
            measured [s], [m/s]; speed_before, speed_after: (T,) simulated.
        scatter: force from stop to stop, for bands [1].
    """

    axes: tuple[AxisResidual, ...]
    before: Floats
    after: Floats
    x: Floats | None
    y: Floats | None
    distance: Floats
    configured: Floats
    found: Floats
    time: Floats
    speed: Floats
    speed_before: Floats
    speed_after: Floats
    scatter: float

    @property
    def changed(self) -> bool:
        """Whether the finding changes any stop of the model as configured."""
        return not np.array_equal(self.found, self.configured)


@dataclass(frozen=True, slots=True)
class Findings:
    """All findings of a log about a model.

    Attributes:
        verdict: one word. summary: one or two sentences.
        effects: named ones, the leading one first. explanations: those that are not ruled out, the
            heaviest first, before stops held out had a say.
        located: axes that the refitted base disagrees along, the strongest first.
        gap: in speed. stop_distance: in metres. next_experiment: what to drive.
        model: to plan with from now on. added: effects in it that were not there before.
        stops: number of stops used. notes: warnings, in sentences. seconds: that it took.
        cost: of what was found. changes: edits of the model file, as text.
        resolvable: change of a stop, beyond what new coefficients can do, from which each effect
            would have been seen in five logs of six like this one [m].
        evidence: residuals that pictures are made of.
    """

    verdict: Verdict
    summary: str
    effects: tuple[NamedEffect, ...]
    explanations: tuple[LikelyExplanation, ...]
    located: tuple[LocatedAxis, ...]
    gap: Gap
    stop_distance: Gap
    next_experiment: Experiment
    model: Model
    added: tuple[Effect, ...]
    stops: int
    notes: tuple[str, ...]
    seconds: float
    cost: StopCost
    changes: tuple[str, ...]
    resolvable: Mapping[str, float]
    evidence: Evidence = field(compare=False)
