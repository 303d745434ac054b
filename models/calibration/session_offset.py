"""The offset of the current session: how far its stops are from the promise of a new one.

    ln(actual / predicted) = ln f½ + δ + ε,   δ ~ N(0, s²) of the session,   ε ~ N(0, w²)

f½ is the median of the table of a calibration and s its `session_std`; w is what its quantiles
spread beyond that. Given the stops of this session δ is Gaussian in closed form,

    V = 1 / (1/s² + Σ 1/w²),   m = V Σ (ln(actual / predicted) − ln f½) / w²,

so every quantile moves with the median by m and contracts from √(s² + w²) to √(V + w²). That is
done with all stops of the session and with the last two only, and the larger factor is used, so
that a change of the brakes is followed with two stops. A session that scatters more than the table
has a larger w. The table in use grows immediately and falls by a rate with each stop. No session is
taken to be shorter by more than s than the force in use, or than the file's if that is stronger.

Validity: stops at full brakes, on the force that is planned with now; when that follows a change,
stops from before it are another session. Effects are not in these predictions: with a lag or fading
brakes they are too short, which is the safe side. Source: none; the normal mean.
"""

from __future__ import annotations

from collections import deque
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.force_design import design
from slopewise.models.laws import braking
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_distance import MAX_FACTOR, MIN_DISTANCE, MIN_PULL, StopDistance

WINDOW = 50
"""Stops that are remembered [1]: by then V is a few percent of w²."""
RECENT = 2
"""Stops that are also used separately [1]: the third stop after a change is planned with two."""
_MIN_SHARE = 0.3
"""The scatter from stop to stop is at least this share of the total spread [1]."""
_PRIOR_STOPS = 6
"""Stops that the scatter of the table counts for, in addition to that of the session [1]."""
_QUANTILE = 0.9
"""At which the spread of a table is read off [1]: tails are part of what lies beyond."""


class SessionStop(NamedTuple):
    """Onset speed [m/s], grade [rad] and distance from the command on [m] of a stop."""

    speed: float
    grade: float
    distance: float


class SessionOffset:
    """The table of one surface as the current session has it; one thread.

    Attributes:
        known: table of the calibration. coefficients: (4,) of the file.
        stops: stops of this session, the newest last.
    """

    def __init__(
        self,
        known: StopDistance,
        coefficients: Floats,
        in_use: StopDistance | None = None,
        stops: tuple[SessionStop, ...] = (),
    ) -> None:
        """Continue a session of which the stops and the table ``in_use`` so far are given."""
        self.known, self._log = known, np.log(np.array(known.stop_factor))
        shape = len(known.levels), len(known.grades), len(known.speeds)
        speed, grade = np.meshgrid(known.speeds, known.grades)
        self._speed, self._grade = (np.broadcast_to(a, shape).ravel() for a in (speed, grade))
        self.coefficients = coefficients
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
            dead_time: likewise [s]. max_fall: largest decrease of ln(factor) with this stop [1].
        """
        self.stops.append(stop)
        required = self._factors(coefficients, dead_time)
        self._in_use = np.maximum(required, self._in_use - max_fall)

    def restart(self, keep: int = 0) -> None:
        """Begin another session, with the last stops of this one."""
        last = list(self.stops)[-keep:] if keep else []
        self.stops.clear()
        self.stops.extend(last)

    def age(self, share: float) -> None:
        """Go back by a share [1] of the way to a new session's table where that allows more."""
        self._in_use += share * np.maximum(self._log - self._in_use, 0.0)

    def widen(self, promise: StopDistance) -> bool:
        """Allow no less than another table at its worst; True if that changed anything."""
        lower = np.log([promise.worst(q) for q in self.known.quantiles])
        rows = np.repeat(lower, len(self._log) // len(lower))[:, None]
        changed = bool(np.any(self._in_use < rows))
        self._in_use = np.maximum(self._in_use, rows)
        return changed

    def _factors(self, coefficients: Floats, dead_time: float) -> Floats:
        """(Q·L·G, V) ln of the factors of this session."""
        known, std = self.known, self.known.session_std
        speed, grade, distance = np.array(self.stops).T
        median = np.log(known.at(0.5, 1.0, speed, grade))
        width = np.log(known.at(_QUANTILE, 1.0, speed, grade)) - median
        distance = np.maximum(distance, MIN_DISTANCE)
        residual = np.log(distance / _predicted(speed, grade, coefficients, dead_time)) - median
        precision = 1.0 / _within(width, std)

        cells = self._log.reshape(len(known.quantiles), -1)
        middle, upper = (np.log(known.row(q)).ravel() for q in (0.5, _QUANTILE))
        within = _within(upper - middle, std)
        by_file, by_planned = (
            _predicted(self._speed, self._grade, c, dead_time)
            for c in (self.coefficients, coefficients)
        )
        shortest = np.minimum(np.log(by_file / by_planned), 0.0) - std
        required = np.full(cells.shape, -np.inf)
        for part in (slice(None), slice(-RECENT, None)):
            of_part, total = residual[part], precision[part].sum()
            spread = float(precision[part] @ (of_part - (precision[part] @ of_part) / total) ** 2)
            wider = max((_PRIOR_STOPS + spread) / (_PRIOR_STOPS + len(of_part) - 1), 1.0)
            variance = 1.0 / (std**-2 + total / wider)
            mean = variance * float(precision[part] @ of_part) / wider
            narrower = np.sqrt((variance + wider * within) / (std**2 + within))
            moved = middle + np.maximum(mean, shortest)
            required = np.maximum(required, moved + (cells - middle) * narrower)
        return required.reshape(self._log.shape)


def _predicted(speed: Floats, grade: Floats, coefficients: Floats, dead_time: float) -> Floats:
    """(n,) distances on even slopes [m]."""
    pull = np.maximum(design(speed, grade) @ coefficients + np.sin(grade), MIN_PULL)
    return np.asarray(braking.stopping_distance(speed, GRAVITY * pull, dead_time, 0.0))


def _within(width: Floats, session_std: float) -> Floats:
    """(n,) variance from stop to stop, by ln of the factor at `_QUANTILE` over the median [1]."""
    total = width / NormalDist().inv_cdf(_QUANTILE)
    result: Floats = np.maximum(total**2 - session_std**2, (_MIN_SHARE * total) ** 2)
    return np.maximum(result, 1e-6)
