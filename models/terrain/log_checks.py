"""Channels of a log whose unit or sign contradicts the vehicle.

Complements :mod:`slopewise.models.stop_logs.drive_quality`, which knows no vehicle. Thresholds are
far from anything that driving does: they mark wrong units and sentinels, not bad driving. Source:
Slip (3) with B_s ≥ B; Slip (13) for thrusts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs.drive_quality import Suspect, SuspectKind, stretches_of
from slopewise.models.terrain.resistances import Drivetrain
from slopewise.models.vehicle import Vehicle

_MAX_THRUST = 5.0  # times the drive's highest, or the weight [1]
_RATIO = 0.15  # relative distance of a ratio of channels from a factor between units [1]
_MOVING = 0.1  # speed [m/s]
_TURNING = 0.1  # difference of the sides [m/s]
_NARROW = 0.1  # slip track over track width that slip cannot explain [1]
_MIN_SAMPLES = 20  # of which a median is taken [1]
_CLEAR = 0.5  # median current above the noise about zero [A]
_AGAINST = 0.2  # share of the yaw rate without slip [1]
_SIDES = ("left", "right")
_CHANNELS = ("v", "v_left", "v_right", "yaw_rate", "current_left", "current_right")


def implausible(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice], vehicle: Vehicle
) -> list[Suspect]:
    """Stretches of a log that contradict its vehicle, which has motor constants.

    ``columns``: channels of the log, (n,). ``runs``: samples of each run.
    """
    suspects: list[Suspect] = []
    drive = Drivetrain.of(vehicle)
    highest = _MAX_THRUST * max(vehicle.max_drive_force, drive.weight) / drive.force_per_ampere
    for name in ("current_left", "current_right"):
        for start, stop in stretches_of(np.abs(np.nan_to_num(columns[name])) > highest):
            value = float(columns[name][start])
            thrust = value * drive.force_per_ampere
            reason = f"{name} of {value:g} A would be a thrust of {thrust:.0f} N"
            suspects.append(Suspect(start, stop, name, SuspectKind.SENTINEL, reason))
    for run in runs:
        part = {name: columns[name][run] for name in _CHANNELS}
        for channel, reason in [*_units(part, vehicle), *_signs(part, vehicle)]:
            suspects.append(Suspect(run.start, run.stop, channel, SuspectKind.UNITS, reason))
    return suspects


def _units(part: Mapping[str, Floats], vehicle: Vehicle) -> Iterator[tuple[str, str]]:
    rim = 0.5 * (part["v_left"] + part["v_right"])
    moving = (np.abs(part["v"]) > _MOVING) & (np.abs(rim) > _MOVING)
    if moving.sum() >= _MIN_SAMPLES:
        ratio = float(np.median(np.abs(rim[moving] / part["v"][moving])))
        units = (("rad/s of these wheels", 1.0 / vehicle.wheel_radius), ("km/h", 3.6))
        error, unit = min((abs(ratio / factor - 1.0), unit) for unit, factor in units)
        if error < _RATIO and abs(ratio - 1.0) > _RATIO:
            fact = f"v_left, v_right are {ratio:.2f} times v, as {unit} would be"
            yield "v_left", f"expected m/s at the rim: {fact}"
    difference, rate = part["v_right"] - part["v_left"], part["yaw_rate"]
    turning = (np.abs(difference) > _TURNING) & np.isfinite(rate)
    if turning.sum() >= _MIN_SAMPLES:
        asked = float(np.median(np.abs(difference[turning])))
        turned = float(np.median(np.abs(rate[turning])))
        if asked < _NARROW * vehicle.track_width * turned:
            fact = f"{turned:.1f} where the wheels give at most {asked / vehicle.track_width:.2f}"
            yield "yaw_rate", f"expected rad/s, got {fact}: degrees per second?"


def _signs(part: Mapping[str, Floats], vehicle: Vehicle) -> Iterator[tuple[str, str]]:
    """Channels whose sign differs from REP-103 and positive currents forward."""
    rim = 0.5 * (part["v_left"] + part["v_right"])
    difference = part["v_right"] - part["v_left"]
    straight = (np.abs(difference) < _TURNING) & (np.abs(rim) > _MOVING)
    straight &= np.isfinite(part["current_left"] + part["current_right"])
    if straight.sum() >= _MIN_SAMPLES:
        direction = np.sign(rim[straight])
        left, right = (float(np.median(part[f"current_{s}"][straight] * direction)) for s in _SIDES)
        if min(left, right) < -_CLEAR and max(left, right) > _CLEAR:
            side = _SIDES[0] if left < right else _SIDES[1]
            fact = f"got {left:.1f} A left and {right:.1f} A right on straights"
            yield f"current_{side}", f"expected positive currents to drive forward, {fact}"
        for side, opposite in zip(_SIDES, (right, left), strict=True):
            if abs(opposite) > _CLEAR and not part[f"current_{side}"].any():
                fact = f"got 0 A throughout, and {opposite:.1f} A on the other side"
                yield f"current_{side}", f"expected the current of a side that drives, {fact}"
    turning = (np.abs(difference) > _TURNING) & np.isfinite(part["yaw_rate"])
    if turning.sum() >= _MIN_SAMPLES:
        achieved = float(np.median(part["yaw_rate"][turning] * np.sign(difference[turning])))
        asked = float(np.median(np.abs(difference[turning]))) / vehicle.track_width
        if achieved < -_AGAINST * asked:
            fact = "it turns against the wheels: sides exchanged, or clockwise positive?"
            yield "yaw_rate", f"expected counter-clockwise positive: {fact}"
