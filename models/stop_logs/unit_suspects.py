"""Channels whose numbers fit another unit than the one their name stands for.

A unit is suspected where channels that have to agree differ by just the factor between two units,
or where a value makes sense in another unit only. A command is no measurement, and wheels may be in
rad/s: against a speed each of them counts only where they agree with each other. Source: none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY

SPEED_FACTORS = {
    "knots": 1.0 / 0.514444,
    "mph": 1.0 / 0.44704,
    "ft/s": 1.0 / 0.3048,
    "km/h": 3.6,
    "cm/s": 100.0,
    "mm/s": 1000.0,
}
"""Unit, as the option --columns writes it -> numbers in it per m/s."""
_TIMES = {"ms": 1e3, "us": 1e6, "ns": 1e9}  # likewise, per second
_STEPS = (5e-4, 2.0)
"""Times between rows of a drive log [s], from which and up to which a unit explains it."""
_LONGEST_STEP = 5.0  # [s] between rows: no stop shows in a log that is that sparse
_RATIO_TOLERANCE = 0.04  # knots and miles per hour differ by 15 %
_STEEP = 0.7  # [rad] 40°: no vehicle spends a twentieth of its time on that
_NEXT_TO_DEGREES = 0.1  # [rad] a pitch of more is steep, next to a yaw in degrees more likely too
_FASTEST_TURN = 8.0  # [rad/s]
_MIN_DISTANCE = 5.0  # [m]


def find(channels: Mapping[str, Floats]) -> Iterator[tuple[str, str]]:
    """(channel, reason) of each suspect channel (n,) of one run.

    Accelerations may be called ``accel_z``, or end so (``imu_acceleration_z``).
    """
    yield from _times(channels["t"])
    yield from _angles(channels)
    yield from _yaw_rate(channels)
    yield from _speeds(channels)
    for name, values in channels.items():
        is_upright = name.endswith(("accel_z", "acceleration_z")) and np.isfinite(values).any()
        if is_upright and abs(float(np.median(np.abs(_finite(values)))) - 1.0) < 0.2:
            expected = f"expected about {GRAVITY:.1f} m/s² upright"
            yield name, f"{expected}, got about 1: looks like g"


def _times(t: Floats) -> Iterator[tuple[str, str]]:
    step = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    if step > _LONGEST_STEP:
        low, high = _STEPS
        units = [unit for unit, factor in _TIMES.items() if low <= step / factor <= high]
        suffix = f", which looks like {' or '.join(units)}" if units else ""
        yield "t", f"expected seconds, got rows that are {step:.3g} apart{suffix}"


def _angles(channels: Mapping[str, Floats]) -> Iterator[tuple[str, str]]:
    wraps = np.abs(np.diff(_finite(channels.get("yaw"))))
    in_degrees = bool(np.any((wraps > 350.0) & (wraps < 365.0)))
    for name in ("pitch", "roll"):
        values = _finite(channels.get(name))
        high = float(np.quantile(np.abs(values), 0.95)) if len(values) else 0.0
        if high > _STEEP:
            yield name, f"expected radians, got {high:.2f}, which looks like degrees or per cent"
        elif high > _NEXT_TO_DEGREES and in_degrees:
            yield name, f"expected radians, got {high:.2f} next to a yaw that jumps by 360: degrees"
    if in_degrees:
        yield "yaw", "expected radians, got jumps by 360, which look like degrees"


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


def _speeds(channels: Mapping[str, Floats]) -> Iterator[tuple[str, str]]:
    """Distances by the speed, by the command, by the wheels and by positions, side by side."""
    v = channels.get("v")
    if v is None:
        return
    if {"x", "y"} <= channels.keys():
        x, y = channels["x"], channels["y"]
        valid = np.isfinite(v) & np.isfinite(x) & np.isfinite(y)
        if valid.sum() < 10:
            return
        t, x, y = channels["t"][valid], x[valid], y[valid]
        # Over whole seconds, so that the noise of positions does not add up to distance.
        marks = np.unique(np.searchsorted(t, np.arange(t[0], t[-1], 1.0)).clip(0, len(t) - 1))
        distance = float(np.sum(np.hypot(np.diff(x[marks]), np.diff(y[marks]))))
        by_speed = float(np.trapezoid(np.abs(v[valid]), t))
        if min(distance, by_speed) >= _MIN_DISTANCE and (unit := _unit(by_speed / distance)):
            yield "v", _reason(by_speed / distance, "what x, y travel", unit)
        return
    references = ("v_cmd", "v_left", "v_right")
    if not channels.keys() >= set(references):
        return
    valid = np.isfinite(np.array([channels[name] for name in ("v", *references)])).all(axis=0)
    if valid.sum() < 10:
        return
    t = channels["t"][valid]
    by_speed, command, left, right = (
        float(np.trapezoid(np.abs(channels[name][valid]), t)) for name in ("v", *references)
    )
    wheels = 0.5 * (left + right)
    if min(by_speed, command, wheels) < _MIN_DISTANCE or abs(command / wheels - 1.0) > 0.1:
        return
    ratio = by_speed / (0.5 * (command + wheels))
    if unit := _unit(ratio):
        yield "v", _reason(ratio, "v_cmd and the wheels", unit)
    elif unit := _unit(1.0 / ratio):
        yield "v_cmd", _reason(1.0 / ratio, "v, as the wheels are", unit)


def _unit(ratio: float) -> str | None:
    """The unit whose factor a ratio is, None if it is that of no unit."""
    near = [
        u for u, factor in SPEED_FACTORS.items() if abs(ratio / factor - 1.0) < _RATIO_TOLERANCE
    ]
    return near[0] if near else None


def _reason(ratio: float, reference: str, unit: str) -> str:
    return f"expected m/s, got {ratio:.2f} times {reference}, which looks like {unit}"


def _finite(values: Floats | None) -> Floats:
    return np.empty(0) if values is None else values[np.isfinite(values)]
