"""How fast rough ground may be driven: the body on its springs, rolled over the candidates.

Body and suspension are a quarter car: y'' = ω² (h − y) + 2 ζ ω (h' − y'), with h the path of the
wheel's centre, ω and ζ the frequency and damping of the bounce. Source: Gillespie, Fundamentals of
Vehicle Dynamics (1992), Ch. 5. Felt is the amplitude √2 · rms of y'' over about as long as a
bounce lasts: that of a sine is its own, and of a sharp edge what it sets going (running rms: ISO
2631-1, 6.3.1). The body as a whole, which the four wheels share, moves less than that.

Every candidate is rolled at a few speeds, the slowest first; what holds is the first speed that is
too fast, so nothing slower is: a resonance in between bars what is beyond it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from models.arrays import Floats, Singles
from models.parameters import Model
from planner.kernels.compiled import kernel, row_pass
from planner.kernels.workspace import empty, empty_singles
from planner.swept.lanes import PLUS_ZERO
from planner.swept.sizes import SweptSizes

_LEVELS, _RATIO = 4, 0.7
"""Speeds tried, and the ratio of each to the next."""

_MEMORY = 1.0 / 3.0
"""Time over which the mean square is taken, in periods: about as long as a bounce lasts."""

_RUN_UP = 2.0
"""Ground behind the first station that the body has come over, in wheelbases."""

_PATCH = 0.5
"""Length of the tyre's contact, over which it evens the ground out, in wheel radii."""

_EMPHASIS = 0.125
"""What straight lines between samples, and means over them, take from a wave: x²/8 at phase x."""


class Ride(NamedTuple):
    """Numbers of the quarter car, its speeds, and how the tyre rolls.

    Attributes:
        frequency: of the bounce [rad/s]. damping: share of the critical one [1].
        limit: highest amplitude of the vertical acceleration [m/s²].
        slowest: of the speeds that are tried, for stations that are ``spacing`` apart [m/s].
        spacing: between stations [m].
        rim: (taps,) how far the rim is above the ground, so many stations from the middle [m].
        patch: stations on each side of the middle that the tyre touches.
        rear, ahead: stations that the rear wheels are behind; that a speed is held before.
    """

    frequency: float
    damping: float
    limit: float
    slowest: float
    spacing: float
    rim: Singles
    patch: int
    rear: int
    ahead: int


def ride_of(model: Model, sizes: SweptSizes, spacing: float) -> Ride:
    """The quarter car of a model on stations so far apart [m]."""
    vehicle, radius = model.vehicle, sizes.radius
    # Where the rim is higher than any step that may be climbed, it touches nothing.
    contact = math.sqrt(radius**2 - max(radius - sizes.max_step, 0.0) ** 2)
    away = spacing * np.arange(1, int(contact / spacing) + 1)
    return Ride(
        2.0 * math.pi * vehicle.ride_frequency,
        vehicle.ride_damping,
        model.limits.vertical_accel,
        model.limits.speed * _RATIO ** (_LEVELS - 1),
        spacing,
        (radius - np.sqrt(radius**2 - away**2)).astype(np.float32),
        int(0.5 * _PATCH * radius / spacing),
        math.ceil(2.0 * sizes.half_length / spacing),
        max(math.ceil(radius / spacing), 1),
    )


def run_up(sizes: SweptSizes, spacing: float) -> int:
    """Stations behind the first one that the body is rolled over before it."""
    return math.ceil(_RUN_UP * 2.0 * sizes.half_length / spacing)


def rough_speeds(behind: Singles, front: Singles, ride: Ride, spacing: Floats) -> Floats:
    """Highest speeds that keep the vertical acceleration within its limit.

    Args:
        behind, front: (B, 2, M), (N, 2, M) ground under the front wheels before the first station
            and from it on [m].
        ride: quarter car.
        spacing: (M,) distance between the stations of each candidate [m].

    Returns:
        (N, M) [m/s], inf where roughness limits nothing.
    """
    stations, _, candidates = front.shape
    count = len(behind) + stations
    path = empty_singles(count, 2, candidates)
    _roll(behind, front, ride, path)
    reached = empty_singles(count, candidates)
    _drive(path, ride, reached)
    held = empty(stations, candidates)
    _hold(reached, ride, spacing / ride.spacing, held)
    return held


@kernel
def _roll(behind: Singles, front: Singles, ride: Ride, path: Singles) -> None:
    """Path of the wheels' centres: over the rim, over the tyre's contact, and sharpened."""
    before, count = behind.shape[0], path.shape[0]
    if ride.patch == 0 and ride.rim.shape[0] == 0:
        for k in range(count):
            for side in range(2):
                _sharpen(
                    _row(behind, front, k - 1, side), _row(behind, front, k, side),
                    _row(behind, front, k + 1, side), path[k, side],
                )  # fmt: skip
        return
    rolled = np.empty_like(path)
    for k in range(count):
        for side in range(2):
            rolled[k, side] = behind[k, side] if k < before else front[k - before, side]
            for n in range(1, ride.rim.shape[0] + 1):
                _touched(
                    _row(behind, front, k - n, side), _row(behind, front, k + n, side),
                    ride.rim[n - 1], rolled[k, side],
                )  # fmt: skip
    evened = np.zeros_like(path)
    share = np.float32(1.0 / (2 * ride.patch + 1))
    for k in range(count):
        for n in range(-ride.patch, ride.patch + 1):
            for side in range(2):
                _add(rolled[min(max(k + n, 0), count - 1), side], share, evened[k, side])
    for k in range(count):
        for side in range(2):
            _sharpen(
                evened[max(k - 1, 0), side], evened[k, side], evened[min(k + 1, count - 1), side],
                path[k, side],
            )  # fmt: skip


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


class _Step(NamedTuple):
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
def _step_of(ride: Ride, time: float) -> _Step:
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
    return _Step(
        f(e[0, 0]), f(e[0, 1] / w), f(e[0, 2] - e[0, 3]), f(e[0, 3]),
        f(e[1, 0] * w), f(e[1, 1]), f((e[1, 2] - e[1, 3]) * w), f(e[1, 3] * w),
        f(2.0 * z * w), f(1.0 / time), f(np.exp(-0.5 * w * time / (np.pi * _MEMORY))),
    )  # fmt: skip


@kernel
def _drive(track: Singles, ride: Ride, reached: Singles) -> None:
    """The first speed that is too fast at each station, (B + N, M) [m/s]; arguments as above."""
    count, _, candidates = track.shape
    state = np.zeros((_LEVELS, 2, 3, candidates), np.float32)
    power = np.empty((2, candidates), np.float32)
    over, under = np.empty(candidates, np.float32), np.empty(candidates, np.float32)
    limit = np.float32(0.5 * ride.limit * ride.limit)
    start = max(min(count - 1, ride.rear + ride.ahead), 1)
    steps = [_step_of(ride, ride.spacing / ride.slowest * _RATIO**n) for n in range(_LEVELS)]
    for level in range(_LEVELS):
        for side in range(2):
            _set_out(
                track[0, side], track[start, side], np.float32(1.0 / start), steps[level],
                state[level, side, 0], state[level, side, 1],
            )  # fmt: skip
    reached[0] = np.float32(np.inf)
    for k in range(1, count):
        fast = reached[k]
        fast[:], power[1] = np.float32(0.0), np.float32(0.0)
        over[:], under[:] = np.float32(0.0), np.float32(0.0)
        for level in range(_LEVELS):
            here, before = power[level % 2], power[1 - level % 2]
            for side in range(2):
                _advance(
                    track[k - 1, side], track[k, side], steps[level], side > 0,
                    state[level, side, 0], state[level, side, 1], state[level, side, 2], here,
                )  # fmt: skip
            _note(here, before, limit, np.float32(ride.slowest / _RATIO**level), over, under, fast)
        _cross(over, under, limit, np.float32(ride.slowest), fast)


@row_pass
def _set_out(
    height: Singles, later: Singles, per_station: np.float32, step: _Step, y: Singles, q: Singles
) -> None:
    """At the height of the ground, rising as it does."""
    for j in range(y.shape[0]):
        y[j] = height[j]
        q[j] = (later[j] - height[j]) * per_station * step.per_time - step.drag * height[j]


@row_pass
def _advance(
    height: Singles, following: Singles, step: _Step, second: bool, y: Singles, q: Singles,
    square: Singles, power: Singles,
) -> None:  # fmt: skip
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


@row_pass
def _note(
    power: Singles, before: Singles, limit: np.float32, speed: np.float32, over: Singles,
    under: Singles, fast: Singles,
) -> None:  # fmt: skip
    """Where this is the first speed that is too fast: it, the mean square there and before."""
    for j in range(power.shape[0]):
        here, last, found = power[j], before[j], fast[j]
        # A product where a choice would be made a branch; all three were zero.
        first = (found == np.float32(0.0)) & (here > limit)
        share = np.float32(1.0) if first else np.float32(0.0)
        over[j] += share * here
        under[j] += share * last
        fast[j] = found + share * speed


@row_pass
def _cross(
    over: Singles, under: Singles, limit: np.float32, slowest: np.float32, fast: Singles
) -> None:
    """Between two speeds the mean square is taken to be linear in v²; below them, in v² as well."""
    least, one, inf = np.float32(_RATIO * _RATIO), np.float32(1.0), np.float32(np.inf)
    for j in range(fast.shape[0]):
        speed, above, below = fast[j], over[j], under[j]
        between = least + (one - least) * (limit - below) / (above - below)
        share = np.sqrt(limit / above if speed == slowest else between)
        fast[j] = (speed * share if speed > np.float32(0.0) else inf) + PLUS_ZERO


@kernel
def _hold(reached: Singles, ride: Ride, scale: Floats, held: Floats) -> None:
    """Speeds hold a little before their place, and until the rear wheels are over it."""
    count, stations = reached.shape[0], held.shape[0]
    # The least of 2, 4, 8 … stations on, each from two halves; then of what is left.
    width, window = 1, ride.rear + ride.ahead + 1
    while 2 * width <= window:
        for k in range(count - width):
            _lower(reached[k + width], reached[k])
        width *= 2
    for k in range(stations):
        first = max(count - stations + k - ride.rear, 0)
        last = min(count - stations + k + ride.ahead, count - 1)
        _slower(
            reached[first], reached[max(last - width + 1, first)], scale, held[k],
        )  # fmt: skip


@row_pass
def _lower(other: Singles, least: Singles) -> None:
    for j in range(least.shape[0]):
        here, there = least[j], other[j]
        least[j] = (there if there < here else here) + PLUS_ZERO


@row_pass
def _slower(first: Singles, last: Singles, scale: Floats, held: Floats) -> None:
    for j in range(held.shape[0]):
        held[j] = min(first[j], last[j]) * scale[j]
