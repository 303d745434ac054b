"""Effects that may be hidden, each in three sizes.

The size is the largest share of the braking force, or of the distance, that the effect takes:
small about 4 %, medium about 10 %, large about 25 %.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .plant_physics import FIELD, Floats, Physics, Stops

SIZES = ("small", "medium", "large")
_SHARES = (0.04, 0.10, 0.25)  # of the braking force [1]

_SCALED: dict[str, tuple[tuple[float, float, float], bool]] = {
    # parameter in each size [SI], whether either sign is possible
    "aerodynamic_drag": ((0.008, 0.02, 0.05), False),
    "viscous_resistance": ((0.005, 0.012, 0.03), False),
    "brake_lag": ((0.04, 0.10, 0.25), False),
    "grade_asymmetry": ((0.12, 0.30, 0.70), True),
    "grade_nonlinearity": ((0.7, 1.7, 4.0), True),
    "cross_slope": ((0.15, 0.35, 0.80), True),
    "turning_resistance": ((0.06, 0.15, 0.35), False),
}
"""Effects of one parameter, with values that take the shares at 3 m/s and grades of 10°."""

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
"""Parameters of the named effects in a report, and the plant's fields for them."""


@dataclass(frozen=True, slots=True)
class HiddenTerm:
    """One effect as the plant has it and as a report should state it."""

    name: str  # of :data:`FIELDS`
    fields: dict[str, float]  # changed fields of :class:`Physics`
    parameters: dict[str, float]  # those of the report, SI


def draw_hidden(
    name: str, size: str, physics: Physics, stops: Stops, rng: np.random.Generator
) -> HiddenTerm:
    """Draw one effect in a size, with its sign, place and direction, where these stops meet it."""
    level = SIZES.index(size)
    sign = float(rng.choice([-1.0, 1.0]))
    vary = float(rng.uniform(0.85, 1.15))
    share = _SHARES[level] * vary
    if name in _SCALED:
        sizes, signed = _SCALED[name]
        parameters = {next(iter(FIELDS[name])): sizes[level] * vary * (sign if signed else 1.0)}
    else:
        parameters = _parameters(name, share, sign, physics, stops, rng)
    return HiddenTerm(name, {FIELDS[name][k]: v for k, v in parameters.items()}, parameters)


def _parameters(
    name: str, share: float, sign: float, p: Physics, stops: Stops, rng: np.random.Generator
) -> dict[str, float]:
    """Parameters of a named effect that takes this share of the braking force."""
    match name:
        case "headwind":
            wind, direction = float(rng.uniform(4.0, 8.0)), float(rng.uniform(-np.pi, np.pi))
            # With and against the wind differ by 4 c v wind.
            c = share * 9.81 * p.b_b / (2.0 * float(np.mean(stops.speed)) * wind)
            return {"c": c, "wind": wind, "direction": direction}
        case "brake_fade":
            tau = float(rng.uniform(80.0, 250.0))
            per_stop = 0.5 * float(np.mean(stops.speed**2))
            heat = per_stop * tau / float(np.median(np.diff(stops.clock)))
            return {"k": share / heat, "tau": tau}
        case "wheel_lockup":
            force = (p.m_m * stops.speed + p.b_m) * stops.grade + p.m_b * stops.speed + p.b_b
            # The hardest stops lose this share, gentle ones lose no force.
            return {"mu": float(np.quantile(force, 0.95)) * (1.0 - share)}
        case "surface_patch":
            radius = float(rng.uniform(150.0, 230.0))
            x = float(rng.uniform(radius, FIELD[0] - radius))
            y = float(rng.uniform(radius, FIELD[1] - radius))
            return {"delta": sign * share * p.b_b, "x": x, "y": y, "radius": radius}
        case "directional_surface":
            return {"k": 0.5 * share * p.b_b, "direction": float(rng.uniform(0.0, np.pi))}
        case "step_change":
            run = float(round(len(stops.speed) * rng.uniform(0.3, 0.7)))
            return {"scale": 1.0 + sign * share, "run": run}
        case "session_drift":
            return {"k": sign * share * p.b_b / float(np.ptp(stops.clock))}
    raise KeyError(name)


Fields = dict[str, float]
Doses = Mapping[str, Sequence[Sequence[Fields]]]

NOT_NEGATIVE = ("drag", "viscous", "lag", "turning", "wind_drag", "fade", "friction")
"""Fields of the plant that cannot be negative."""

FREE: dict[str, Fields] = {
    "aerodynamic_drag": {"drag": 1e-4},
    "viscous_resistance": {"viscous": 1e-4},
    "brake_lag": {"lag": 1e-3},
    "grade_asymmetry": {"asymmetry": 1e-2},
    "grade_nonlinearity": {"nonlinearity": 1e-2},
    "cross_slope": {"cross_slope": 1e-2},
    "turning_resistance": {"turning": 1e-3},
    "headwind": {"wind_drag": 1e-4, "wind": 0.05, "wind_direction": 1e-2},
    "brake_fade": {"fade": 1e-5, "fade_tau": 1.0},
    "wheel_lockup": {"friction": 1e-3},
    "surface_patch": {"patch": 1e-3},
    "directional_surface": {"furrow": 1e-3, "furrow_direction": 1e-2},
    "step_change": {"step_scale": 1e-3},
    "session_drift": {"drift": 1e-7},
}
"""Fitted fields of each effect, with steps for finite differences [SI]."""

ONE_SIGN = {name for name, fields in FREE.items() if next(iter(fields)) in NOT_NEGATIVE}
"""Effects whose coefficient cannot be negative."""


def amplified(name: str, dose: Sequence[Fields], factor: Floats) -> Fields:
    """Fields of an effect that is a multiple of a small dose."""
    first = dict(dose[0])
    match name:
        case "wheel_lockup":
            return first
        case "directional_surface":
            size = first["furrow"] * float(np.hypot(*factor))
            return {
                "furrow": size,
                "furrow_direction": 0.5 * float(np.arctan2(factor[1], factor[0])),
            }
        case "step_change":
            return first | {"step_scale": 1.0 + float(factor[0]) * (first["step_scale"] - 1.0)}
    key = next(iter(first))
    return first | {key: first[key] * float(factor[0])}


def small_doses(p: Physics, stops: Stops) -> Doses:
    """Doses of every named effect; those in one inner list are fitted together."""
    force = (p.m_m * stops.speed + p.b_m) * stops.grade + p.m_b * stops.speed + p.b_b
    count = len(stops.speed)
    angles = np.arange(8) * np.pi / 4.0
    # A light wind with much drag is, in one direction, a loss proportional to the speed.
    winds = [
        [{"wind_drag": 1e-3, "wind": w, "wind_direction": a}] for w in (0.3, 5.0) for a in angles
    ]
    patches = [
        [{"patch": 0.005, "patch_x": x, "patch_y": y, "patch_radius": 185.0}]
        for x in np.linspace(170.0, FIELD[0] - 170.0, 5)
        for y in np.linspace(170.0, FIELD[1] - 170.0, 3)
    ]
    furrows = [{"furrow": 0.005, "furrow_direction": a} for a in (0.0, np.pi / 4.0)]
    return {
        "aerodynamic_drag": [[{"drag": 1e-3}]],
        "viscous_resistance": [[{"viscous": 1e-3}]],
        "brake_lag": [[{"lag": tau}] for tau in (0.01, 0.1)],
        "grade_asymmetry": [[{"asymmetry": 0.01}]],
        "grade_nonlinearity": [[{"nonlinearity": 0.05}]],
        "cross_slope": [[{"cross_slope": 0.02}]],
        "turning_resistance": [[{"turning": 0.01}]],
        "headwind": winds,
        "brake_fade": [[{"fade": 0.02 / 50.0, "fade_tau": t}] for t in (60.0, 120.0, 300.0)],
        "wheel_lockup": [[{"friction": q}] for q in np.quantile(force, (0.35, 0.55, 0.75, 0.9))],
        "surface_patch": patches,
        "directional_surface": [furrows],
        "step_change": [
            [{"step_scale": 0.99, "step_run": float(r)}]
            for r in np.unique(np.linspace(0.15, 0.85, 9) * count // 1)
        ],
        "session_drift": [[{"drift": 0.01 / float(np.ptp(stops.clock))}]],
    }
