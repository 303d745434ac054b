"""Formulas of all effects, written down once more from their definitions, in plain floats.

The laws of the registry are compared with them, and the plant of drive logs brakes by them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, exp, hypot

G = 9.80665


@dataclass(slots=True, kw_only=True)
class Moment:
    """State of a braking vehicle, SI and radians; `force` is F_b/W before the effect."""

    grade: float = 0.0
    roll: float = 0.0
    yaw: float = 0.0
    x: float = 0.0
    y: float = 0.0
    curvature: float = 0.0
    vertical_curvature: float = 0.0
    speed: float = 0.0
    session_time: float = 0.0
    since_onset: float = 0.0
    heat: float = 0.0
    force: float = 0.0


Formula = Callable[[Mapping[str, float], Moment], float]


def _headwind(p: Mapping[str, float], m: Moment) -> float:
    air = m.speed + p["wind"] * cos(m.yaw - p["direction"])
    return p["c"] * (abs(air) * air - m.speed**2)


def _crest_share(p: Mapping[str, float], m: Moment) -> float:
    """The ground that falls away carries less: W cos θ + m v² dθ/ds."""
    lost = max(-m.vertical_curvature, 0.0) * m.speed**2 / G
    return max(1.0 - p["k"] * lost, 0.0)


FORCE: dict[str, Formula] = {
    "grade_asymmetry": lambda p, m: p["k"] * max(m.grade, 0.0),
    "grade_nonlinearity": lambda p, m: p["k"] * m.grade * abs(m.grade),
    "cross_slope": lambda p, m: p["k"] * abs(m.roll),
    "surface_patch": lambda p, m: p["delta"] * (hypot(m.x - p["x"], m.y - p["y"]) <= p["radius"]),
    "directional_surface": lambda p, m: p["k"] * cos(2.0 * (m.yaw - p["direction"])),
    "session_drift": lambda p, m: p["k"] * m.session_time,
}
"""Added to F_b/W."""

DECELERATION: dict[str, Formula] = {
    "aerodynamic_drag": lambda p, m: p["c"] * m.speed**2,
    "headwind": _headwind,
    "viscous_resistance": lambda p, m: G * p["c"] * m.speed,
    "turning_resistance": lambda p, m: G * p["k"] * abs(m.curvature) * m.speed,
}
"""Added to the deceleration [m/s²]."""

FORMULAS: dict[str, Formula] = {
    **FORCE,
    **DECELERATION,
    "step_change": lambda p, m: m.force * p["scale"] + p.get("delta", 0.0),
    "brake_lag": lambda p, m: exp(-m.since_onset / p["tau"]),
    "brake_fade": lambda p, m: 1.0 / (1.0 + p["k"] * m.heat),
    "wheel_lockup": lambda p, m: p["mu"] * cos(m.grade) * cos(m.roll),
    "crest_unloading": _crest_share,
}
"""All effects: what each adds, leaves or allows, as its law in the registry returns it."""

SAMPLES: dict[str, dict[str, float]] = {
    "aerodynamic_drag": {"c": 0.03},
    "headwind": {"c": 0.02, "wind": 5.0, "direction": 0.4},
    "viscous_resistance": {"c": 0.02},
    "turning_resistance": {"k": 0.1},
    "brake_lag": {"tau": 0.15},
    "brake_fade": {"k": 0.02, "tau": 10.0},
    "wheel_lockup": {"mu": 0.4},
    "grade_asymmetry": {"k": 0.5},
    "grade_nonlinearity": {"k": 1.5},
    "cross_slope": {"k": 0.2},
    "crest_unloading": {"k": 0.8},
    "surface_patch": {"delta": -0.1, "x": 4.0, "y": 0.0, "radius": 2.0},
    "directional_surface": {"k": 0.05, "direction": 0.3},
    "session_drift": {"k": 1e-5},
    "step_change": {"delta": -0.05},
}
"""A plausible size of each."""
