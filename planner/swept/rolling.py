"""The path of a wheel's centre over the ground of many candidates."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Singles
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.swept.lanes import PLUS_ZERO
from slopewise.planner.swept.ride import Ride

_EMPHASIS = 0.125
"""What straight lines between samples, and means over them, take from a wave: x²/8 at phase x."""


@kernel
def roll(behind: Singles, front: Singles, ride: Ride, path: Singles) -> None:
    """Path of the wheels' centres: over the rim, over the tyre's contact, and sharpened."""
    before, count = behind.shape[0], path.shape[0]
    if ride.patch == 0 and ride.rim.shape[0] == 0:
        for k in range(count):
            for side in range(2):
                _sharpen(
                    _row(behind, front, k - 1, side),
                    _row(behind, front, k, side),
                    _row(behind, front, k + 1, side),
                    path[k, side],
                )
        return
    rolled = np.empty_like(path)
    for k in range(count):
        for side in range(2):
            rolled[k, side] = behind[k, side] if k < before else front[k - before, side]
            for n in range(1, ride.rim.shape[0] + 1):
                _touched(
                    _row(behind, front, k - n, side),
                    _row(behind, front, k + n, side),
                    ride.rim[n - 1],
                    rolled[k, side],
                )
    evened = np.zeros_like(path)
    share = np.float32(1.0 / (2 * ride.patch + 1))
    for k in range(count):
        for n in range(-ride.patch, ride.patch + 1):
            for side in range(2):
                _add(rolled[min(max(k + n, 0), count - 1), side], share, evened[k, side])
    for k in range(count):
        for side in range(2):
            _sharpen(
                evened[max(k - 1, 0), side],
                evened[k, side],
                evened[min(k + 1, count - 1), side],
                path[k, side],
            )


@kernel
def _row(behind: Singles, front: Singles, k: int, side: int) -> Singles:
    """Row k of both, the first or last one beyond them."""
    before = behind.shape[0]
    row: Singles = front[max(min(k - before, front.shape[0] - 1), 0), side]
    if k < before:
        row = behind[max(k, 0), side]
    return row


@row_pass
def _touched(behind: Singles, ahead: Singles, rim: np.float32, path: Singles) -> None:
    for j in range(path.shape[0]):
        here, beside = path[j], max(behind[j], ahead[j]) - rim
        path[j] = (beside if beside > here else here) + PLUS_ZERO


@row_pass
def _add(height: Singles, share: np.float32, total: Singles) -> None:
    for j in range(total.shape[0]):
        total[j] += share * height[j]


@row_pass
def _sharpen(behind: Singles, here: Singles, ahead: Singles, out: Singles) -> None:
    share, two = np.float32(_EMPHASIS), np.float32(2.0)
    for j in range(out.shape[0]):
        out[j] = here[j] + share * (two * here[j] - behind[j] - ahead[j])
