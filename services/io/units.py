"""Columns of a drive log, their units, and the factors of other units to them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

TEXT = ("run", "terrain", "session")
REQUIRED = {"t": "s", "v": "m/s", "v_cmd": "m/s", "pitch": "rad"}
OPTIONAL = {
    "roll": "rad",
    "yaw": "rad",
    "yaw_rate": "rad/s",
    "x": "m",
    "y": "m",
    "path_x": "m",
    "path_y": "m",
    "v_left": "m/s",
    "v_right": "m/s",
    "current_left": "A",
    "current_right": "A",
    "brake": "1",
}
REPLAYED = {"vertical_curvature": "1/m"}
"""Read by replays only."""

_DEGREE = math.pi / 180.0  # [rad]
_SPEEDS = {"km/h": 1.0 / 3.6, "mph": 0.44704, "knots": 0.514444, "kn": 0.514444}
FACTORS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
        "m/s": {"m/s": 1.0, **_SPEEDS, "cm/s": 1e-2, "mm/s": 1e-3, "ft/s": 0.3048},
        "rad": {"rad": 1.0, "mrad": 1e-3, "deg": _DEGREE, "°": _DEGREE, "%": 0.01},
        "rad/s": {"rad/s": 1.0, "deg/s": _DEGREE, "°/s": _DEGREE, "rpm": math.pi / 30},
        "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048},
        "1/m": {"1/m": 1.0},
        "A": {"A": 1.0, "mA": 1e-3},
        "1": {"1": 1.0, "%": 0.01},
    }
)
"""Unit of a drive log -> factor of each unit that a file may have."""


def factor_to(unit: str, written: str) -> float | None:
    """Factor from a written unit to that of a drive log; a number is a factor; None if neither.

    A quotient such as 1/80 counts as its number; nothing written is the drive log's own unit.
    """
    if not written:
        return 1.0
    if written in FACTORS[unit]:
        return FACTORS[unit][written]
    above, _, below = written.partition("/")
    try:
        factor = float(above) / float(below or 1.0)
    except (ValueError, ZeroDivisionError):
        return None
    return factor if math.isfinite(factor) and factor > 0.0 else None


def finite(value: float) -> float | None:
    """The value, None where it is not finite, which JSON cannot hold."""
    return float(value) if math.isfinite(value) else None
