"""Score of a finding, compared with the truth of its set, and on fresh stops of the plant.

Stops of the same design in the same session are driven as the truth has them, with noise and
scatter, and as the plant has them with the configured, the found and the true model. The score so
rests on the content of a finding and not on the product's simulation of it.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .blind_run import COEFFICIENTS, Finding
from .catalogue import HiddenSet, sampled_late
from .effect_plant import drive, speeds
from .hidden_effects import FIELDS, HiddenTerm
from .plant_physics import Physics, draw
from .sensing import RATE

MIN_GAP = 1.5  # Gap, over the floor, from which a closed share is meaningful [1]
_MIN_SPEED = 0.1  # [m/s] of compared samples


@dataclass(frozen=True, slots=True)
class Closing:
    """Disagreement of speeds on fresh stops, root mean square [m/s]."""

    before: float  # by the configured model
    after: float  # by the finding
    floor: float  # by the truth itself

    @property
    def share(self) -> float | None:
        """Closed share of the closable gap; None where the gap is too small."""
        return closed_share(self.before, self.after, self.floor)


def closed_share(before: float, after: float, floor: float) -> float | None:
    """Closed share of the closable gap; None where the gap is too small."""
    return None if before < MIN_GAP * floor else (before - after) / (before - floor)


def closing(hidden: HiddenSet, finding: Finding) -> Closing:
    """Drive fresh stops by the configured, the found and the true model."""
    rng = np.random.default_rng((hidden.spec.seed, 9))
    stops = draw(hidden.design, len(hidden.stops.speed), hidden.scatter, rng)
    stops = sampled_late(stops._replace(clock=hidden.stops.clock), rng)
    time = np.arange(0, round(10.0 * RATE)) / RATE
    real = drive(hidden.truth, stops, time)
    rolling = (real.speed > _MIN_SPEED) & np.isfinite(real.distance)[:, None]
    noise = hidden.noise * rng.standard_normal(real.speed.shape)
    calm = stops._replace(friction=np.ones_like(stops.speed), delay=np.zeros_like(stops.speed))
    base = Physics(**(dict.fromkeys(COEFFICIENTS, 0.0) | hidden.configured))
    # The dead time of a log counts from the sample at which it shows the command.
    truth = hidden.truth._replace(dead_time=hidden.truth.dead_time - 0.5 / RATE)
    gaps = [
        float(np.sqrt(np.mean(((real.speed + noise - speeds(physics, calm, time))[rolling]) ** 2)))
        for physics in (base, physics_of(finding, base), truth)
    ]
    return Closing(*gaps)


def physics_of(finding: Finding, base: Physics) -> Physics:
    """The plant with the coefficients and effects of a finding; a surface may lie in places."""
    physics, counts = base._replace(**(finding.braking or {})), Counter[str]()
    for name, parameters in finding.added:
        counts[name] += 1
        suffix = "" if counts[name] == 1 else f"_{counts[name]}"
        fields = {k: v.replace("patch", f"patch{suffix}") for k, v in FIELDS[name].items()}
        physics = physics._replace(**{fields[k]: float(v) for k, v in parameters.items()})
    return physics


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
    """One set with its scored finding."""  # words: ok, keys of results

    kind: str  # kind, truth, size, seed, design, stops, noise, scatter: description of the set
    truth: tuple[str, ...]
    size: str
    seed: int
    design: str
    stops: int
    noise: float
    scatter: float
    gap: float  # gap, nearest, apart: expected χ², see :class:`.identifiability.Identifiability`
    nearest: str
    apart: float  # words: ok, a key of results
    identifiable: bool  # whether the log suffices for a right answer
    verdict: str  # verdict, named, alternatives: finding
    named: tuple[str, ...]
    alternatives: tuple[str, ...]
    right: bool  # whether exactly the true names were given, with confidence
    wrong: bool  # whether a false name was given with confidence
    located: str  # strongest axis
    axis_right: bool  # whether it is one of the effect's
    # whether the 95 % interval of each parameter of a named effect holds the truth
    covered: dict[str, bool]
    closing: Closing  # gap on fresh stops
    seconds: float  # processor time per 100 stops [s]
    text: str  # text, worse: see :class:`.blind_run.Finding`
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
    request = (spec.kind, spec.names, spec.size, spec.seed)
    conditions = (hidden.design, stops, hidden.noise, hidden.scatter)
    expected = (known.gap, known.nearest, known.apart, hidden.identifiable)
    return SetOutcome(
        *request,
        *conditions,
        *expected,
        *(finding.verdict, finding.names, tuple(sorted(alternatives))),
        right=finding.is_confident and named == truth,
        wrong=finding.is_confident and bool(named - truth),
        located=axis,
        axis_right=any(axis in AXES.get(name, ()) for name in spec.names),
        covered=_covered(hidden.hidden, finding) if finding.is_confident else {},
        closing=closing(hidden, finding),
        seconds=finding.seconds * 100.0 / max(stops, 1),
        text=finding.text,
        worse=finding.worse,
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
