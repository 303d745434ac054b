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

import numpy as np

from slopewise.models.arrays import Floats, Singles
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.kernels.workspace import empty, empty_singles
from slopewise.planner.swept.lanes import PLUS_ZERO
from slopewise.planner.swept.quarter_car import advance, bounce_step, set_out
from slopewise.planner.swept.ride import LEVELS, RATIO, Ride
from slopewise.planner.swept.rolling import roll


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
    roll(behind, front, ride, path)
    reached = empty_singles(count, candidates)
    _drive(path, ride, reached)
    held = empty(stations, candidates)
    _hold(reached, ride, spacing / ride.spacing, held)
    return held


@kernel
def _drive(track: Singles, ride: Ride, reached: Singles) -> None:
    """The first speed that is too fast at each station, (B + N, M) [m/s]; arguments as above."""
    count, _, candidates = track.shape
    state = np.zeros((LEVELS, 2, 3, candidates), np.float32)
    power = np.empty((2, candidates), np.float32)
    over, under = np.empty(candidates, np.float32), np.empty(candidates, np.float32)
    limit = np.float32(0.5 * ride.limit * ride.limit)
    start = max(min(count - 1, ride.rear + ride.ahead), 1)
    steps = [bounce_step(ride, ride.spacing / ride.slowest * RATIO**n) for n in range(LEVELS)]
    for level in range(LEVELS):
        for side in range(2):
            set_out(
                track[0, side],
                track[start, side],
                np.float32(1.0 / start),
                steps[level],
                state[level, side, 0],
                state[level, side, 1],
            )
    reached[0] = np.float32(np.inf)
    for k in range(1, count):
        fast = reached[k]
        fast[:], power[1] = np.float32(0.0), np.float32(0.0)
        over[:], under[:] = np.float32(0.0), np.float32(0.0)
        for level in range(LEVELS):
            here, before = power[level % 2], power[1 - level % 2]
            for side in range(2):
                advance(
                    track[k - 1, side],
                    track[k, side],
                    steps[level],
                    side > 0,
                    state[level, side, 0],
                    state[level, side, 1],
                    state[level, side, 2],
                    here,
                )
            _note(here, before, limit, np.float32(ride.slowest / RATIO**level), over, under, fast)
        _cross(over, under, limit, np.float32(ride.slowest), fast)


@row_pass
def _note(
    power: Singles,
    before: Singles,
    limit: np.float32,
    speed: np.float32,
    over: Singles,
    under: Singles,
    fast: Singles,
) -> None:
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
    least, one, inf = np.float32(RATIO * RATIO), np.float32(1.0), np.float32(np.inf)
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
            reached[first],
            reached[max(last - width + 1, first)],
            scale,
            held[k],
        )


@row_pass
def _lower(other: Singles, least: Singles) -> None:
    for j in range(least.shape[0]):
        here, there = least[j], other[j]
        least[j] = (there if there < here else here) + PLUS_ZERO


@row_pass
def _slower(first: Singles, last: Singles, scale: Floats, held: Floats) -> None:
    for j in range(held.shape[0]):
        held[j] = min(first[j], last[j]) * scale[j]
