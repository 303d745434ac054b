"""One finding beside its truth."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from .catalogue import HiddenSet
from .fresh import Closing, closing
from .hidden import HiddenTerm
from .sealed import InquiryFinding

_PARTNERS = {"headwind": math.tau, "directional_surface": math.pi}
_WIDTH = 1.959964  # standard deviations that hold 95 %

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
    """One set, one finding, and what to think of it.

    Attributes:
        kind, truth, size, design, stops, noise, scatter: what it was.
        gap, nearest, apart: expected χ², see :class:`benchmarks.discovery.worth.Worth`.
        identifiable: it can be found and told from its rivals.
        verdict, named, alternatives: what was said.
        right: the true names, all of them and no other, with confidence.
        wrong: a name that is not true was given with confidence.
        located: the strongest axis; axis_right: it is one of the effect's.
        covered: per parameter of a rightly named effect, whether its 95 % interval holds the truth.
        closing: on fresh stops. told: the workflow's own share. seconds: per 100 stops.
        worse: see :class:`.sealed.Finding`.
    """

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
    apart: float
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
    told: float | None
    seconds: float
    text: str
    worse: float = 0.0

    def record(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self) | {"closed": self.closing.share}


def score(hidden: HiddenSet, finding: InquiryFinding) -> SetOutcome:
    """Compare."""
    order = hidden.order
    sure = finding.verdict == "missing_effect"
    truth, named = set(order.names), set(finding.names)
    others = {name for effect in finding.effects for name in effect["alternatives"]}
    axis = finding.located[0][0] if finding.located else ""
    wanted = {word for name in order.names for word in AXES.get(name, ())}
    return SetOutcome(
        order.kind,
        order.names,
        order.size,
        order.seed,
        hidden.design,
        len(hidden.stops.speed),
        hidden.noise,
        hidden.scatter,
        hidden.worth.gap,
        hidden.worth.nearest,
        hidden.worth.apart,
        hidden.identifiable,
        finding.verdict,
        finding.names,
        tuple(sorted(others)),
        sure and named == truth,
        sure and bool(named - truth),
        finding.located[0][0] if finding.located else "",
        axis in wanted,
        _covered(hidden.hidden, finding) if sure else {},
        closing(hidden, finding),
        finding.closed,
        finding.seconds * 100.0 / max(len(hidden.stops.speed), 1),
        finding.text,
        finding.worse,
    )


def _covered(hidden: tuple[HiddenTerm, ...], finding: InquiryFinding) -> dict[str, bool]:
    """Whether each 95 % interval holds the truth; what is no number to be estimated is left out."""
    found = {}
    by_name = {effect["name"]: effect["parameters"] for effect in finding.effects}
    for effect in hidden:
        said = by_name.get(effect.name, {})
        for key, true in effect.parameters.items():
            value, std = said.get(key, (math.nan, math.nan))
            if key == "run" or not (math.isfinite(value) and std > 0.0):
                continue
            found[f"{effect.name}.{key}"] = _apart(effect.name, key, value, true) <= _WIDTH * std
    return found


def _apart(name: str, key: str, value: float, true: float) -> float:
    if key == "direction":
        turn = _PARTNERS[name]
        return abs((value - true + 0.5 * turn) % turn - 0.5 * turn)
    return abs(value - true)
