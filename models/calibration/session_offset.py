"""The offset of the current session: how far its stops are from the promise of a new one.

    ln(actual / predicted) = ln f½ + δ + ε,   δ ~ N(0, s²) of the session,   ε ~ N(0, w²)

f½ is the median of the table of a calibration and s its `session_std`; w is what its quantiles
spread beyond that. Given the stops of this session δ is Gaussian in closed form,

    V = 1 / (1/s² + Σ 1/w²),   m = V Σ (ln(actual / predicted) − ln f½) / w²,

so every quantile moves with the median by m and contracts from √(s² + w²) to √(V + w²). That is
done with all stops of the session and with the last two only, and the larger factor is used, so
that a change of the brakes is followed immediately. The table in use grows immediately and falls by
a rate with each stop. No session is taken to be shorter than by s, so that what is left is never
less than its own scatter, whatever distances are reported.

Validity: predictions by the force that is planned with now; when that follows a change, stops from
before it are another session. Source: none; the normal mean with known variance.
"""

from __future__ import annotations

from collections import deque
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.force_design import design
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_distance import MAX_FACTOR, StopDistance

WINDOW = 50
"""Stops that are remembered [1]: by then V is a few percent of w²."""
RECENT = 2
"""Stops that are also used separately [1]: the third stop after a change is planned with two."""
_MIN_SHARE = 0.3
"""Of the spread of a table that is from stop to stop at least [1]."""
_QUANTILE = 0.9
"""At which the spread of a table is read off [1]: tails are part of what lies beyond."""
_MIN_DISTANCE = 1e-3
"""Of a stop [m]."""
_MIN_PULL = 0.01
"""Deceleration as a share of gravity below which there is no finite stop [1]."""


class SessionStop(NamedTuple):
    """Onset speed [m/s], grade [rad] and distance from the command on [m] of a stop."""

    speed: float
    grade: float
    distance: float


class SessionOffset:
    """The table of one surface as the current session has it; one thread.

    Args:
        known: table of the calibration. law: its coefficients (4,).
        in_use: table of this session so far.
        stops: stops of this session, speed [m/s], grade [rad], distance [m].

    Attributes:
        known: table of the calibration. stops: stops of this session, the newest last.
    """

    def __init__(
        self,
        known: StopDistance,
        law: Floats,
        in_use: StopDistance | None = None,
        stops: tuple[SessionStop, ...] = (),
    ) -> None:
        self.known, self._log = known, np.log(np.array(known.stop_factor))
        shape = len(known.levels), len(known.grades), len(known.speeds)
        speed, grade = np.meshgrid(known.speeds, known.grades)
        self._speed, self._grade = (np.broadcast_to(a, shape).ravel() for a in (speed, grade))
        self.law = law
        begin = self._log if in_use is None else np.log(np.array(in_use.stop_factor))
        if begin.shape != self._log.shape:
            raise ParameterError("distance", f"a table of {self._log.shape}, got {begin.shape}")
        self._in_use: Floats = begin.copy()
        self.stops = deque(stops, maxlen=WINDOW)

    @property
    def table(self) -> StopDistance:
        """The table to plan with."""
        return self.known.with_factors(np.minimum(np.exp(self._in_use), MAX_FACTOR))

    def take(
        self, stop: SessionStop, coefficients: Floats, dead_time: float, max_fall: float
    ) -> None:
        """One more stop of the session.

        Args:
            stop: measured. coefficients: (4,) that are planned with now, after it was learned from.
            dead_time: likewise [s]. max_fall: fall of the logarithm of a factor with one stop [1].
        """
        self.stops.append(stop)
        required = self._factors(coefficients, dead_time)
        self._in_use = np.maximum(required, self._in_use - max_fall)

    def restart(self, keep: int = 0) -> None:
        """Begin another session, with the last stops of this one."""
        last = list(self.stops)[len(self.stops) - keep :]
        self.stops.clear()
        self.stops.extend(last)

    def age(self, share: float) -> None:
        """Go back to a new session's table where that allows more."""
        self._in_use += share * np.maximum(self._log - self._in_use, 0.0)

    def _factors(self, coefficients: Floats, dead_time: float) -> Floats:
        """(Q L G, V) logarithms of the factors of this session."""
        known, std = self.known, self.known.session_std
        speed, grade, distance = np.array(self.stops).T
        median = np.log(known.at(0.5, 1.0, speed, grade))
        width = np.log(known.at(_QUANTILE, 1.0, speed, grade)) - median
        distance = np.maximum(distance, _MIN_DISTANCE)
        residual = np.log(distance / _predicted(speed, grade, coefficients, dead_time)) - median
        precision = 1.0 / _within(width / NormalDist().inv_cdf(_QUANTILE), std)

        cells = self._log.reshape(len(known.quantiles), -1)
        middle, upper = (np.log(known.row(q)).ravel() for q in (0.5, _QUANTILE))
        within = _within((upper - middle) / NormalDist().inv_cdf(_QUANTILE), std)
        by_file, now = (
            _predicted(self._speed, self._grade, c, dead_time) for c in (self.law, coefficients)
        )
        shortest = np.minimum(np.log(by_file / now), 0.0) - std
        required = np.full(cells.shape, -np.inf)
        for part in (slice(None), slice(-RECENT, None)):
            variance = 1.0 / (std**-2 + precision[part].sum())
            mean = variance * float(precision[part] @ residual[part])
            narrower = np.sqrt((variance + within) / (std**2 + within))
            moved = middle + np.maximum(mean, shortest)
            required = np.maximum(required, moved + (cells - middle) * narrower)
        result: Floats = required.reshape(self._log.shape)
        return result


def _predicted(speed: Floats, grade: Floats, coefficients: Floats, dead_time: float) -> Floats:
    """(n,) distances on even slopes [m]."""
    pull = design(speed, grade) @ coefficients + np.sin(grade)
    result: Floats = speed * dead_time + speed**2 / (2.0 * GRAVITY * np.maximum(pull, _MIN_PULL))
    return result


def _within(total: Floats, session_std: float) -> Floats:
    """Variance from stop to stop, of the standard deviation of new sessions [1]."""
    result: Floats = np.maximum(total**2 - session_std**2, (_MIN_SHARE * total) ** 2)
    return np.maximum(result, 1e-6)
