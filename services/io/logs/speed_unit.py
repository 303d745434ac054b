"""Speeds of a log that are not in m/s, by what the vehicle can do and by what came out of them.

In a unit f times as fine, speeds and decelerations are f times too large: F_b/W + sin θ comes out f
times as large, so that b_m, the change of F_b/W with the grade, comes near f b_m + f − 1. Source:
none; Braking (7), (8).
"""

from __future__ import annotations

import numpy as np

from slopewise.models.errors import InputError
from slopewise.models.parameters import Braking, Model
from slopewise.services.io.access import fault
from slopewise.services.io.logs.drive_log import DriveLog

_FACTORS = {"km/h": 3.6, "miles per hour": 1.0 / 0.44704, "knots": 1.0 / 0.514444}
_TOO_FAST = 1.5
_NEAR, _ALIKE = 0.2, 0.12
"""How near b_m, and the force's factor, have to come [1]: knots and miles differ by 15 %."""

_STEEP = 0.02
"""Grades that vary by less tell nothing of b_m [rad]."""


def refuse_too_fast(log: DriveLog, model: Model) -> None:
    """Raise InputError where a log drives far faster than the vehicle's wheels can turn."""
    most = model.vehicle.max_wheel_speed
    for run, source in zip(log.runs, log.sources, strict=True):
        speeds = np.abs(log.columns["v"][run])
        speeds = speeds[np.isfinite(speeds)]
        if not len(speeds):
            continue
        fast = float(np.quantile(speeds, 0.95))
        if fast > _TOO_FAST * most:
            fitting = [name for name, factor in _FACTORS.items() if fast / factor <= most]
            units = " or ".join(fitting) or "another unit"
            words = f"expected m/s of wheels that turn at up to {most:g} m/s, got {fast:.3g}"
            raise fault(source, "column v", f"{words}, which looks like {units}")


def suspect_of(learned: Braking, known: Braking, grades: np.ndarray) -> str:
    """Why coefficients look like those of speeds in another unit; empty if they do not.

    Args:
        learned: out of the log. known: before. grades: (n,) of the stops [rad].
    """
    if len(grades) < 2 or float(np.std(grades)) < _STEEP:
        return ""
    for unit, factor in _FACTORS.items():
        wrong = factor * known.b_m + factor - 1.0
        level = learned.b_b / max(known.b_b, 1e-9)
        if abs(learned.b_m - wrong) < _NEAR and abs(level / factor - 1.0) < _ALIKE:
            words = f"brakes {level:.2g} times as strong as known and b_m {learned.b_m:+.2f}"
            return f"expected m/s, got {words}, which looks like {unit}"
    return ""


def refuse_unit(learned: Braking, known: Braking, grades: np.ndarray, source: str) -> None:
    """Raise InputError where what was learned is what speeds in another unit would teach."""
    if words := suspect_of(learned, known, grades):
        raise InputError(source, "column v", words)
