"""What may be hidden: every named effect in three sizes, pairs, and effects that have no name.

A size is meant as the share of the braking force, or of the way, that the effect takes at its most:
small about 4 %, medium about 10 %, large about 25 %.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .designs import FIELD
from .physics import Physics, Stops

SIZES = ("small", "medium", "large")

PAIRS = (
    ("aerodynamic_drag", "cross_slope"),
    ("aerodynamic_drag", "step_change"),
    ("viscous_resistance", "grade_asymmetry"),
    ("viscous_resistance", "surface_patch"),
    ("brake_lag", "session_drift"),
    ("brake_lag", "cross_slope"),
    ("brake_lag", "directional_surface"),
    ("brake_fade", "grade_nonlinearity"),
    ("brake_fade", "brake_lag"),
    ("headwind", "grade_asymmetry"),
    ("surface_patch", "step_change"),
    ("surface_patch", "aerodynamic_drag"),
    ("turning_resistance", "cross_slope"),
    ("session_drift", "grade_nonlinearity"),
    ("wheel_lockup", "directional_surface"),
    ("step_change", "directional_surface"),
)

OFF_LIBRARY = ("ambient", "ripple", "bump", "grab", "overshoot")

_ONE_PARAMETER: dict[str, tuple[str, str, tuple[float, float, float], bool]] = {
    # field of the plant, name of the parameter, sizes, whether either sign is possible
    "aerodynamic_drag": ("drag", "c", (0.008, 0.02, 0.05), False),
    "viscous_resistance": ("viscous", "c", (0.005, 0.012, 0.03), False),
    "brake_lag": ("lag", "tau", (0.04, 0.10, 0.25), False),
    "grade_asymmetry": ("asymmetry", "k", (0.12, 0.30, 0.70), True),
    "grade_nonlinearity": ("nonlinearity", "k", (0.7, 1.7, 4.0), True),
    "cross_slope": ("cross_slope", "k", (0.15, 0.35, 0.80), True),
    "turning_resistance": ("turning", "k", (0.06, 0.15, 0.35), False),
}

NAMED = (
    *_ONE_PARAMETER,
    "headwind",
    "brake_fade",
    "wheel_lockup",
    "surface_patch",
    "directional_surface",
    "step_change",
    "session_drift",
)


FIELDS: dict[str, dict[str, str]] = {
    "aerodynamic_drag": {"c": "drag"},
    "viscous_resistance": {"c": "viscous"},
    "headwind": {"c": "wind_drag", "wind": "wind", "direction": "wind_direction"},
    "brake_lag": {"tau": "lag"},
    "brake_fade": {"k": "fade", "tau": "fade_tau"},
    "wheel_lockup": {"mu": "friction"},
    "grade_asymmetry": {"k": "asymmetry"},
    "grade_nonlinearity": {"k": "nonlinearity"},
    "cross_slope": {"k": "cross_slope"},
    "turning_resistance": {"k": "turning"},
    "surface_patch": {"delta": "patch", "x": "patch_x", "y": "patch_y", "radius": "patch_radius"},
    "directional_surface": {"k": "furrow", "direction": "furrow_direction"},
    "step_change": {"scale": "step_scale", "delta": "step_delta", "run": "step_run"},
    "session_drift": {"k": "drift"},
}
"""Parameters of the named effects, as a report puts them, and fields of the plant."""


@dataclass(frozen=True, slots=True)
class HiddenTerm:
    """One effect as the plant has it and as a report should put it.

    Attributes:
        name: of the effect.
        fields: of :class:`Physics`.
        parameters: of the report's vocabulary, SI.
    """

    name: str
    fields: dict[str, float]
    parameters: dict[str, float] = field(default_factory=dict)


def draw_hidden(
    name: str, size: str, physics: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    """One effect in a size, where these stops meet it.

    Args:
        name: one of :data:`NAMED` or :data:`OFF_LIBRARY`. size: one of :data:`SIZES`.
        physics: the base. stops: what is driven. rng: draws signs, places, directions.
    """
    level = SIZES.index(size)
    sign = float(rng.choice([-1.0, 1.0]))
    vary = float(rng.uniform(0.85, 1.15))
    share = (0.04, 0.10, 0.25)[level] * vary
    if name in _ONE_PARAMETER:
        key, parameter, sizes, either = _ONE_PARAMETER[name]
        value = sizes[level] * vary * (sign if either else 1.0)
        return HiddenTerm(name, {key: value}, {parameter: value})
    return _DRAWN[name](share, sign, physics, stops, rng)


def _headwind(
    share: float, _: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    wind, direction = float(rng.uniform(4.0, 8.0)), float(rng.uniform(-np.pi, np.pi))
    # With and against the wind differ by 4 c v wind.
    c = share * 9.81 * p.b_b / (2.0 * float(np.mean(stops.speed)) * wind)
    values = {"c": c, "wind": wind, "direction": direction}
    return HiddenTerm(
        "headwind", {"wind_drag": c, "wind": wind, "wind_direction": direction}, values
    )


def _fade(share: float, _: float, p: Physics, stops: Stops, rng: np.random.Generator) -> HiddenTerm:
    tau = float(rng.uniform(80.0, 250.0))
    per_stop = 0.5 * float(np.mean(stops.speed**2))
    usual = per_stop * tau / float(np.median(np.diff(stops.clock)))
    k = share / usual
    return HiddenTerm("brake_fade", {"fade": k, "fade_tau": tau}, {"k": k, "tau": tau})


def _lockup(
    share: float, _: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    force = (p.m_m * stops.speed + p.b_m) * stops.grade + p.m_b * stops.speed + p.b_b
    # The hardest stops lose this share, the others nothing.
    mu = float(np.quantile(force, 0.95)) * (1.0 - share)
    return HiddenTerm("wheel_lockup", {"friction": mu}, {"mu": mu})


def _patch(
    share: float, sign: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    radius = float(rng.uniform(150.0, 230.0))
    x = float(rng.uniform(radius, FIELD[0] - radius))
    y = float(rng.uniform(radius, FIELD[1] - radius))
    delta = sign * share * p.b_b
    fields = {"patch": delta, "patch_x": x, "patch_y": y, "patch_radius": radius}
    return HiddenTerm("surface_patch", fields, {"delta": delta, "x": x, "y": y, "radius": radius})


def _furrow(
    share: float, _: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    k, direction = 0.5 * share * p.b_b, float(rng.uniform(0.0, np.pi))
    fields = {"furrow": k, "furrow_direction": direction}
    return HiddenTerm("directional_surface", fields, {"k": k, "direction": direction})


def _step(
    share: float, sign: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    run = float(round(len(stops.speed) * rng.uniform(0.3, 0.7)))
    scale = 1.0 + sign * share
    return HiddenTerm(
        "step_change", {"step_scale": scale, "step_run": run}, {"scale": scale, "run": run}
    )


def _drift(
    share: float, sign: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    k = sign * share * p.b_b / float(np.ptp(stops.clock))
    return HiddenTerm("session_drift", {"drift": k}, {"k": k})


def _ambient(
    share: float, sign: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    return HiddenTerm("ambient", {"ambient": sign * share * p.b_b / 20.0})


def _ripple(
    share: float, _: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    length = float(rng.uniform(300.0, 500.0))
    return HiddenTerm("ripple", {"ripple": share * p.b_b, "ripple_length": length})


def _bump(
    share: float, sign: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    where = float(np.quantile(stops.grade, rng.uniform(0.3, 0.7)))
    fields = {"bump": sign * 1.5 * share * p.b_b, "bump_grade": where, "bump_width": 0.03}
    return HiddenTerm("bump", fields)


def _grab(share: float, _: float, p: Physics, stops: Stops, rng: np.random.Generator) -> HiddenTerm:
    return HiddenTerm(
        "grab", {"grab": 3.0 * share * p.b_b, "grab_speed": float(rng.uniform(0.2, 0.4))}
    )


def _overshoot(
    share: float, _: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    late = float(rng.uniform(0.25, 0.4))
    return HiddenTerm("overshoot", {"overshoot": 2.0 * share * p.b_b, "overshoot_time": late})


_DRAWN = {
    "headwind": _headwind,
    "brake_fade": _fade,
    "wheel_lockup": _lockup,
    "surface_patch": _patch,
    "directional_surface": _furrow,
    "step_change": _step,
    "session_drift": _drift,
    "ambient": _ambient,
    "ripple": _ripple,
    "bump": _bump,
    "grab": _grab,
    "overshoot": _overshoot,
}
