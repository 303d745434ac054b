"""What a vehicle's own sizes say of a log: channels that cannot have the unit or sign they should.

Beside :mod:`slopewise.models.stop_logs.drive_quality`, which knows no vehicle. Thresholds are far
from anything that driving does: they mark wrong units and sentinels, not bad driving. Source: Slip
(3) with B_s ≥ B; Slip (13) for thrusts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs.drive_quality import Suspect, SuspectKind, stretches_of
from slopewise.models.terrain.resistances import Drivetrain
from slopewise.models.vehicle import Vehicle

_THRUST = 5.0  # times what the drive can give, or the weight holds
_RATIO = 0.15  # how near a ratio of channels has to be to a factor between units
_MOVING = 0.1  # [m/s]
_TURNING = 0.1  # [m/s] difference of the sides
_NARROW = 0.1  # a slip track below this share of the track width is none
_LEAST = 20  # samples
_CLEAR = 0.5  # [A] mean current that is no noise about zero
_AGAINST = 0.2  # share of the yaw rate without slip
_SIDES = ("left", "right")
_CHANNELS = ("v", "v_left", "v_right", "yaw_rate", "current_left", "current_right")


def implausible(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice], vehicle: Vehicle
) -> list[Suspect]:
    """Stretches of a log that contradict the vehicle it is said to be of.

    Args:
        columns: channels of a drive log, (n,).
        runs: samples of each run.
        vehicle: with motor constants.
    """
    found: list[Suspect] = []
    drive = Drivetrain.of(vehicle)
    most = _THRUST * max(vehicle.max_drive_force, drive.weight) / drive.force_per_ampere
    for name in ("current_left", "current_right"):
        for start, stop in stretches_of(np.abs(np.nan_to_num(columns[name])) > most):
            value = float(columns[name][start])
            words = (
                f"{name} of {value:g} A would be a thrust of {value * drive.force_per_ampere:.0f} N"
            )
            found.append(Suspect(start, stop, name, SuspectKind.SENTINEL, words))
    for run in runs:
        part = {name: columns[name][run] for name in _CHANNELS}
        for channel, words in [*_units(part, vehicle), *_signs(part, vehicle)]:
            found.append(Suspect(run.start, run.stop, channel, SuspectKind.UNITS, words))
    return found


def _units(part: Mapping[str, Floats], vehicle: Vehicle) -> list[tuple[str, str]]:
    found = []
    rim = 0.5 * (part["v_left"] + part["v_right"])
    moving = (np.abs(part["v"]) > _MOVING) & (np.abs(rim) > _MOVING)
    if moving.sum() >= _LEAST:
        ratio = float(np.median(np.abs(rim[moving] / part["v"][moving])))
        by_radius = 1.0 / vehicle.wheel_radius
        if abs(ratio / by_radius - 1.0) < _RATIO and abs(ratio - 1.0) > _RATIO:
            words = f"v_left, v_right are {ratio:.2f} times v, as rad/s of these wheels would be"
            found.append(("v_left", f"expected m/s at the rim: {words}"))
    difference, rate = part["v_right"] - part["v_left"], part["yaw_rate"]
    turning = (np.abs(difference) > _TURNING) & np.isfinite(rate)
    if turning.sum() >= _LEAST:
        asked = float(np.median(np.abs(difference[turning])))
        turned = float(np.median(np.abs(rate[turning])))
        if asked < _NARROW * vehicle.track_width * turned:
            words = f"{turned:.1f} where the wheels give at most {asked / vehicle.track_width:.2f}"
            found.append(("yaw_rate", f"expected rad/s, got {words}: degrees per second?"))
    return found


def _signs(part: Mapping[str, Floats], vehicle: Vehicle) -> list[tuple[str, str]]:
    """Channels whose sign is another than REP-103 and a positive current forward have it."""
    found = []
    rim = 0.5 * (part["v_left"] + part["v_right"])
    difference = part["v_right"] - part["v_left"]
    straight = (np.abs(difference) < _TURNING) & (np.abs(rim) > _MOVING)
    straight &= np.isfinite(part["current_left"] + part["current_right"])
    if straight.sum() >= _LEAST:
        direction = np.sign(rim[straight])
        left, right = (float(np.median(part[f"current_{s}"][straight] * direction)) for s in _SIDES)
        if min(left, right) < -_CLEAR and max(left, right) > _CLEAR:
            side = _SIDES[0] if left < right else _SIDES[1]
            words = f"got {left:.1f} A left and {right:.1f} A right on straights"
            found.append(
                (f"current_{side}", f"expected positive currents to drive forward, {words}")
            )
    turning = (np.abs(difference) > _TURNING) & np.isfinite(part["yaw_rate"])
    if turning.sum() >= _LEAST:
        achieved = float(np.median(part["yaw_rate"][turning] * np.sign(difference[turning])))
        asked = float(np.median(np.abs(difference[turning]))) / vehicle.track_width
        if achieved < -_AGAINST * asked:
            words = "it turns against the wheels: sides exchanged, or clockwise positive?"
            found.append(("yaw_rate", f"expected counter-clockwise positive: {words}"))
    return found
