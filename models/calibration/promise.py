"""Promise that n stops of m sessions support: counted, or resting on an assumption.

Without any law the next stop of these sessions is within the longest of n with probability
n/(n+1), and a stop of a new session within that of m sessions with m/(m+1). Beyond that a promise
rests on the tails of the distribution. Held-out sessions show how it fares on days that it
has not seen.

Source: order statistics (Wilks 1941); interval of Clopper and Pearson (1934) at the effective
number of stops, n / (1 + (n/m − 1) ICC) (Kish 1965).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from slopewise.models.arrays import Floats
from slopewise.models.calibration.distance_model import StopFeatures, fit_distance
from slopewise.models.calibration.distance_table import LearnedDistance

_FOLDS = 8
"""Groups in which sessions are held out, where there are more of them [1]."""
_MIN_REST = 6
"""Stops without which the others predict nothing [1]."""


@dataclass(frozen=True, slots=True)
class Promise:
    """Promise that the stops of a surface support.

    Attributes:
        share: promised. stops, sessions: n, m.
        counted_here, counted_new: n/(n+1) for these sessions, m/(m+1) for new ones.
        held_out, held_out_beyond: stops of sessions predicted by the others, and those beyond.
        interval: 95 % of the share beyond, exact at the effective number of stops; None where no
            session could be held out.
        excess: mean of allowed minus actual distance of these [m].
    """

    share: float
    stops: int
    sessions: int
    held_out: int
    held_out_beyond: int
    interval: tuple[float, float] | None
    excess: float | None

    @property
    def counted_here(self) -> float:
        """Share that is counted for the sessions of the log."""
        return self.stops / (self.stops + 1.0)

    @property
    def counted_new(self) -> float:
        """Share that is counted for a session that was not seen."""
        return self.sessions / (self.sessions + 1.0)

    @property
    def more_stops(self) -> int:
        """Stops to drive until the promised share is counted for these sessions."""
        return max(math.ceil(self.share / (1.0 - self.share) - 1e-9) - self.stops, 0)

    @property
    def more_sessions(self) -> int:
        """Sessions likewise, for new ones."""
        return max(math.ceil(self.share / (1.0 - self.share) - 1e-9) - self.sessions, 0)

    def sentence(self) -> str:
        """The promise as text."""
        sentence = (
            f"{self.stops} stops of {self.sessions} session{'s' if self.sessions > 1 else ''}: "
            f"{self.counted_here:.1%} is counted for these sessions and {self.counted_new:.1%} for "
            f"new ones"
        )
        if self.more_stops or self.more_sessions:
            sentence += f"; up to {self.share:.4g} rests on the shape of the tails"
        if self.interval is not None:
            low, high = self.interval
            sentence += (
                f"; of held-out sessions {self.held_out_beyond} of {self.held_out} stops were "
                f"beyond ({low:.1%} … {high:.1%})"
            )
        if self.sessions < 3:
            sentence += "; drive on other days: one session says little of the next"
        elif self.more_stops:
            sentence += f"; drive {self.more_stops} more stops to count {self.share:.4g} in these"
        return sentence


@lru_cache(maxsize=32)
def promise_of(learned: LearnedDistance, share: float) -> Promise:
    """Promise that the stops of a surface support at a share; a second for 100 stops."""
    excess = _held_out(learned, share)
    count, beyond = len(excess), int(np.sum(excess < 0.0))
    interval = None
    if count:
        interval = share_interval(beyond, count, learned.log_ratio, learned.session)
    return Promise(
        share,
        len(learned.log_ratio),
        int(learned.session.max()) + 1,
        count,
        beyond,
        interval,
        float(np.mean(excess)) if count else None,
    )


def _held_out(learned: LearnedDistance, share: float) -> Floats:
    """Allowed minus actual distance [m] of stops predicted by the other sessions."""
    group_of = learned.session % _FOLDS
    actual = np.exp(learned.log_ratio) * learned.at.distance
    excess = [np.empty(0)]
    for group in np.unique(group_of):
        out = group_of == group
        if (~out).sum() < _MIN_REST:
            continue
        rest = StopFeatures(*(column[~out] for column in learned.at))
        model = fit_distance(rest, learned.log_ratio[~out], learned.session[~out])
        held_out = StopFeatures(*(column[out] for column in learned.at))
        ratio = model.log_ratio(held_out, np.array([share]))[0]
        excess.append(np.exp(ratio) * held_out.distance - actual[out])
    return np.concatenate(excess)


def share_interval(
    beyond: int, count: int, values: Floats, session: NDArray[Any]
) -> tuple[float, float]:
    """95 % interval of the share ``beyond`` of ``count`` stops, at their effective number."""
    effective = effective_count(values, session, count)
    return beyond_interval(beyond * effective / count, effective)


def effective_count(values: Floats, session: NDArray[Any], count: int) -> float:
    """Effective number of stops, by the intraclass correlation of values (n,) within sessions."""
    names, index = np.unique(session, return_inverse=True)
    m, n = len(names), len(values)
    if m < 2 or n <= m:
        return float(count)
    size = np.bincount(index)
    means = np.bincount(index, values) / size
    within = float(np.sum((values - means[index]) ** 2)) / (n - m)
    between = float(np.sum(size * (means - values.mean()) ** 2)) / (m - 1)
    typical = (n - float(np.sum(size**2)) / n) / (m - 1)
    icc = max((between - within) / (between + (typical - 1.0) * within + 1e-300), 0.0)
    return count / (1.0 + max(count / m - 1.0, 0.0) * icc)


def beyond_interval(beyond: float, count: float) -> tuple[float, float]:
    """95 % interval of a share, exact for a count that need not be whole."""
    hits = min(beyond, count)
    low = float(stats.beta.ppf(0.025, hits, count - hits + 1.0)) if hits > 0.0 else 0.0
    high = float(stats.beta.ppf(0.975, hits + 1.0, count - hits)) if hits < count else 1.0
    return low, high
