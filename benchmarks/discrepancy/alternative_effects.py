"""Small doses of every named effect, as alternatives to the hidden one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .designs import FIELD
from .plant_physics import Floats, Physics, Stops

Fields = dict[str, float]
Doses = Mapping[str, Sequence[Sequence[Fields]]]

ONE_SIGN = {
    "aerodynamic_drag",
    "viscous_resistance",
    "brake_lag",
    "turning_resistance",
    "headwind",
    "brake_fade",
    "wheel_lockup",
}
"""Effects whose coefficient cannot be negative."""

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
