"""Channels whose numbers fit another unit than the one their name stands for.

A unit is suspected where two channels that have to agree differ by just the factor between two
units, or where a value makes sense in another unit only. Source: none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY

_SPEED_FACTORS = {
    "knots": 1.0 / 0.514444,
    "km/h": 3.6,
    "miles per hour": 1.0 / 0.44704,
    "mm/s": 1000.0,
}
_RATIO_TOLERANCE = 0.04  # knots and miles per hour differ by 15 %
_STEEP = 0.7  # [rad] 40°: no vehicle spends a twentieth of its time on that
_FASTEST_TURN = 8.0  # [rad/s]
_MIN_DISTANCE = 5.0  # [m]


def find(channels: Mapping[str, Floats]) -> Iterator[tuple[str, str]]:
    """(channel, reason) of each suspect channel of one run.

    Args:
        channels: (n,) by name, with ``t`` [s]; accelerations may be called ``accel_x``, ``accel_z``
            or end so (``imu_acceleration_z``).
    """
    yield from _angles(channels)
    yield from _yaw_rate(channels)
    yield from _speed(channels)
    yield from _accelerations(channels)


def _angles(channels: Mapping[str, Floats]) -> Iterator[tuple[str, str]]:
    for name in ("pitch", "roll"):
        values = _finite(channels.get(name))
        if len(values) and (high := float(np.quantile(np.abs(values), 0.95))) > _STEEP:
            yield name, f"expected radians, got {high:.2f}, which looks like degrees"


def _yaw_rate(channels: Mapping[str, Floats]) -> Iterator[tuple[str, str]]:
    rate = channels.get("yaw_rate")
    values = _finite(rate)
    if rate is None or not len(values):
        return
    if float(np.quantile(np.abs(values), 0.99)) > _FASTEST_TURN:
        yield "yaw_rate", "expected rad/s, got values that look like degrees per second"
        return
    yaw = channels.get("yaw")
    if yaw is None or not (np.isfinite(yaw).all() and np.isfinite(rate).all()):
        return
    turned = float(np.sum(np.abs(np.diff(np.unwrap(yaw)))))
    integrated = float(np.sum(np.abs(rate[1:]) * np.diff(channels["t"])))
    if turned > 1.0 and abs(integrated / turned / np.rad2deg(1.0) - 1.0) < 0.3:
        yield "yaw_rate", "expected rad/s, got 57 times the change of yaw: degrees per second"


def _speed(channels: Mapping[str, Floats]) -> Iterator[tuple[str, str]]:
    v = channels.get("v")
    if v is None or not {"x", "y"} <= channels.keys():
        return
    x, y = channels["x"], channels["y"]
    valid = np.isfinite(v) & np.isfinite(x) & np.isfinite(y)
    if valid.sum() < 10:
        return
    t, v, x, y = channels["t"][valid], v[valid], x[valid], y[valid]
    # Over whole seconds, so that the noise of positions does not add up to distance.
    marks = np.unique(np.searchsorted(t, np.arange(t[0], t[-1], 1.0)).clip(0, len(t) - 1))
    distance = float(np.sum(np.hypot(np.diff(x[marks]), np.diff(y[marks]))))
    integrated = float(np.trapezoid(np.abs(v), t))
    if distance < _MIN_DISTANCE or integrated < _MIN_DISTANCE:
        return
    for unit, factor in _SPEED_FACTORS.items():
        if abs(integrated / distance / factor - 1.0) < _RATIO_TOLERANCE:
            ratio = f"{integrated / distance:.2f} times what x, y travel, which looks like {unit}"
            yield "v", f"expected m/s, got {ratio}"


def _accelerations(channels: Mapping[str, Floats]) -> Iterator[tuple[str, str]]:
    for name, values in channels.items():
        finite = _finite(values)
        if not name.endswith(("accel_z", "acceleration_z")) or not len(finite):
            continue
        if abs(float(np.median(np.abs(finite))) - 1.0) < 0.2:
            yield name, f"expected about {GRAVITY:.1f} m/s² upright, got about 1: looks like g"


def _finite(values: Floats | None) -> Floats:
    return np.empty(0) if values is None else values[np.isfinite(values)]
