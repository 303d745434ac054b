"""Score of a finding, compared with the truth of its set."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from .blind_run import Finding
from .catalogue import HiddenSet
from .fresh_stops import Closing, closing
from .hidden_effects import HiddenTerm

_PERIODS = {"headwind": math.tau, "directional_surface": math.pi}  # [rad] of their direction
_Z_95 = 1.959964  # standard deviations that hold 95 %

_IN_STOP = ("speed", "time_since_onset", "onset_speed")
_GRADE = ("grade", "abs_grade")
_SESSION = ("time", "run")

AXES: dict[str, tuple[str, ...]] = {
    "aerodynamic_drag": _IN_STOP,
    "viscous_resistance": _IN_STOP,
    "headwind": ("heading", "speed"),
    "brake_lag": _IN_STOP,
    "brake_fade": ("brake_heat", *_SESSION),
    "wheel_lockup": (*_GRADE, "onset_speed"),
    "grade_asymmetry": _GRADE,
    "grade_nonlinearity": _GRADE,
    "cross_slope": ("roll",),
    "turning_resistance": ("yaw_rate",),
    "surface_patch": ("place", "x", "y"),
    "directional_surface": ("heading",),
    "step_change": _SESSION,
    "session_drift": _SESSION,
    "ambient": ("ambient",),
    "ripple": ("x", "place"),
    "bump": _GRADE,
    "grab": _IN_STOP,
    "overshoot": _IN_STOP,
}
"""Axes on which an effect shows, by their names in findings."""


@dataclass(frozen=True, slots=True)
class SetOutcome:
    """One set with its scored finding.

    Attributes:
        kind, truth, size, seed, design, stops, noise, scatter: description of the set.
        gap, nearest, apart: expected χ², see :class:`.identifiability.Identifiability`.
        identifiable: whether the log suffices for a right answer.
        verdict, named, alternatives: finding.
        right: whether exactly the true names were given, with confidence.
        wrong: whether a false name was given with confidence.
        located: strongest axis.
        axis_right: whether it is one of the effect's.
        covered: whether the 95 % interval of each parameter of a named effect holds the truth.
        closing: gap on fresh stops.
        told: the workflow's own closed share.
        seconds: processor time per 100 stops [s].
        text, worse: see :class:`.blind_run.Finding`.
    """  # words: ok, keys of results

    kind: str
    truth: tuple[str, ...]
    size: str
    seed: int
    design: str
    stops: int
    noise: float
    scatter: float
    gap: float
    nearest: str
    apart: float  # words: ok, a key of results
    identifiable: bool
    verdict: str
    named: tuple[str, ...]
    alternatives: tuple[str, ...]
    right: bool
    wrong: bool
    located: str
    axis_right: bool
    covered: dict[str, bool]
    closing: Closing
    told: float | None  # words: ok, a key of results
    seconds: float
    text: str
    worse: float = 0.0

    def record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self) | {"closed": self.closing.share}


def score(hidden: HiddenSet, finding: Finding) -> SetOutcome:
    """Compare a finding with the truth."""
    spec, known = hidden.spec, hidden.identifiability
    truth, named = set(spec.names), set(finding.names)
    alternatives = {name for effect in finding.effects for name in effect["alternatives"]}
    axis = finding.located[0][0] if finding.located else ""
    stops = len(hidden.stops.speed)
    return SetOutcome(
        spec.kind,
        spec.names,
        spec.size,
        spec.seed,
        hidden.design,
        stops,
        hidden.noise,
        hidden.scatter,
        known.gap,
        known.nearest,
        known.apart,
        hidden.identifiable,
        finding.verdict,
        finding.names,
        tuple(sorted(alternatives)),
        finding.is_confident and named == truth,
        finding.is_confident and bool(named - truth),
        axis,
        any(axis in AXES.get(name, ()) for name in spec.names),
        _covered(hidden.hidden, finding) if finding.is_confident else {},
        closing(hidden, finding),
        finding.closed,
        finding.seconds * 100.0 / max(stops, 1),
        finding.text,
        finding.worse,
    )


def _covered(hidden: tuple[HiddenTerm, ...], finding: Finding) -> dict[str, bool]:
    """Whether each 95 % interval holds the truth; parameters without an interval are omitted."""
    covered = {}
    by_name = {effect["name"]: effect["parameters"] for effect in finding.effects}
    for term in hidden:
        estimates = by_name.get(term.name, {})
        for key, true in term.parameters.items():
            value, std = estimates.get(key, (math.nan, math.nan))
            if key == "run" or not (math.isfinite(value) and std > 0.0):
                continue
            error = abs(value - true)
            if key == "direction":
                period = _PERIODS[term.name]
                error = abs((value - true + 0.5 * period) % period - 0.5 * period)
            covered[f"{term.name}.{key}"] = error <= _Z_95 * std
    return covered
