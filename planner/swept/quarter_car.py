"""The body on its springs: one station of a quarter car at one speed, for many candidates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Singles
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.swept.lanes import PLUS_ZERO
from slopewise.planner.swept.ride import Ride

_MEMORY = 1.0 / 3.0
"""Time over which the mean square is taken, in periods: about as long as a bounce lasts."""


class BounceStep(NamedTuple):
    """One station of the quarter car at one speed, float32: y and q = y' − 2 ζ ω h follow from
    y, q, h and the next h; ``per_time`` is 1 / Δt, ``keep`` what the mean square keeps.
    """

    yy: np.float32
    yq: np.float32
    yh: np.float32
    yn: np.float32
    qy: np.float32
    qq: np.float32
    qh: np.float32
    qn: np.float32
    drag: np.float32
    per_time: np.float32
    keep: np.float32


@kernel
def bounce_step(ride: Ride, time: float) -> BounceStep:
    """Exact for heights that are linear in between: the exponential of [y, q / ω, h, h' Δt]."""
    w, z = ride.frequency, ride.damping
    halvings = 0
    while w * time > 0.5 * 2.0**halvings:
        halvings += 1
    t = time / 2.0**halvings
    m = np.zeros((4, 4))
    m[0, 1], m[0, 2] = w * t, 2.0 * z * w * t
    m[1, 0], m[1, 1], m[1, 2] = -w * t, -2.0 * z * w * t, (1.0 - 4.0 * z * z) * w * t
    m[2, 3] = t / time
    e, term = np.eye(4), np.eye(4)
    for n in range(1, 16):
        new = np.zeros((4, 4))
        for a in range(4):
            for b in range(4):
                for c in range(4):
                    new[a, b] += term[a, c] * m[c, b] / n
        term = new
        e += term
    for _ in range(halvings):
        square = np.zeros((4, 4))
        for a in range(4):
            for b in range(4):
                for c in range(4):
                    square[a, b] += e[a, c] * e[c, b]
        e = square
    f = np.float32
    return BounceStep(
        f(e[0, 0]),
        f(e[0, 1] / w),
        f(e[0, 2] - e[0, 3]),
        f(e[0, 3]),
        f(e[1, 0] * w),
        f(e[1, 1]),
        f((e[1, 2] - e[1, 3]) * w),
        f(e[1, 3] * w),
        f(2.0 * z * w),
        f(1.0 / time),
        f(np.exp(-0.5 * w * time / (np.pi * _MEMORY))),
    )


@row_pass
def set_out(
    height: Singles,
    later: Singles,
    per_station: np.float32,
    step: BounceStep,
    y: Singles,
    q: Singles,
) -> None:
    """At the height of the ground, rising as it does."""
    for j in range(y.shape[0]):
        y[j] = height[j]
        q[j] = (later[j] - height[j]) * per_station * step.per_time - step.drag * height[j]


@row_pass
def advance(
    height: Singles,
    following: Singles,
    step: BounceStep,
    second: bool,
    y: Singles,
    q: Singles,
    square: Singles,
    power: Singles,
) -> None:
    """One station on; ``power`` is the mean square of the acceleration, of two sides the higher."""
    for j in range(y.shape[0]):
        h, n, place, rate = height[j], following[j], y[j], q[j]
        new = step.qy * place + step.qq * rate + step.qh * h + step.qn * n
        y[j] = step.yy * place + step.yq * rate + step.yh * h + step.yn * n
        q[j] = new
        accel = (new - rate + step.drag * (n - h)) * step.per_time
        mean = accel * accel
        mean += step.keep * (square[j] - mean)
        square[j] = mean
        other = power[j] if second else mean
        power[j] = (mean if mean > other else other) + PLUS_ZERO
