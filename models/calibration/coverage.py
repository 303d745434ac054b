"""Coverage of the stops of a log by a model: distances that plans allow and that stops took.

Every stop that was measured counts, also one from a speed that plans do not allow at all: that one
is not covered. The model is not updated. It covers a log if no more stops are
beyond than chance makes of the share that its quantile leaves.
Source: none; exact binomial test and interval.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.special import ndtri

from slopewise.models.arrays import Bools, Floats
from slopewise.models.calibration.effects_in_force import net_of_effects
from slopewise.models.calibration.promise import share_interval
from slopewise.models.calibration.stopping import stopping_distance
from slopewise.models.calibration.uphill import extra_force
from slopewise.models.parameters import Braking, Model
from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow
from slopewise.models.stop_logs.measured_log import measure_stops
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.models.stop_promise import promised_braking

_LEVEL_STEP = 0.1
"""To which brake levels are rounded down [1]: promises are computed once for each."""
_CHANCE = 0.05
"""Probability of that many stops beyond by chance, below which a model does not cover them."""
MIN_STOPS = 8
"""Stops below which a log does not show whether a model covers it [1]: with seven, even one that
covers nine stops of ten has all of them within by chance in half of the logs."""


@dataclass(frozen=True, slots=True)
class Coverage:
    """Stops of a log compared with what plans allow for them, n measured stops.

    Attributes:
        records: the stops. allowed: (n,) distance that plans allow for [m], inf where they let no
            such speed. session: (n,) number of the session. windows: all stops that were found.
        quantile: one-sided probability of the plans.
    """

    records: tuple[StopRecord, ...]
    allowed: Floats
    session: NDArray[Any]
    windows: tuple[StopWindow, ...]
    quantile: float

    @property
    def excess(self) -> Floats:
        """(n,) allowed minus actual distance [m]; −inf where the speed itself is not allowed."""
        excess = self.allowed - np.array([r.samples.distance for r in self.records])
        return np.where(np.isfinite(self.allowed), excess, -np.inf)

    def of(self, members: Bools) -> Coverage:
        """Some of the stops, (n,) whether to take each."""
        records = tuple(r for r, ok in zip(self.records, members.tolist(), strict=True) if ok)
        return replace(
            self, records=records, allowed=self.allowed[members], session=self.session[members]
        )

    def decides(self) -> bool:
        """There are enough stops for an answer."""
        return len(self.records) >= MIN_STOPS

    def covers(self) -> bool:
        """The stops beyond are no more than chance allows, and there are stops."""
        beyond = int(np.sum(self.excess < 0.0))
        chance = stats.binom.sf(beyond - 1, len(self.records), 1.0 - self.quantile)
        return len(self.records) > 0 and float(chance) >= _CHANCE

    def interval(self) -> tuple[float, float]:
        """95 % of the share beyond, exact at the effective number of stops."""
        excess, n = self.excess, len(self.records)
        if n == 0:
            return 0.0, 1.0
        distance = np.array([r.samples.distance for r in self.records])
        ratio = np.log(np.where(np.isfinite(self.allowed), self.allowed, distance) / distance)
        return share_interval(int(np.sum(excess < 0.0)), n, ratio, self.session)


def covered(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    model: Model,
    *,
    ground: Floats | None = None,
    quantile: float = 0.999,
) -> Coverage:
    """Compare a model with the stops of a log.

    Args:
        columns: channels of a drive log, (n,). runs: samples of each run. model: to judge.
        ground: (n,) grade of the ground from a map [rad]. quantile: one-sided, of plans.

    Raises:
        ParameterError: no usable stop; says how many were found and what was wrong with them.
    """
    b = model.braking
    log = measure_stops(
        columns,
        runs,
        lambda v: b.m_m * v + b.b_m,
        lambda _, mount: (mount, lambda v: b.m_m * v + b.b_m),
        ground=ground,
        settings=StopSettings(partial=True),
        min_count=1,
    )
    records = net_of_effects(log.measured, model, columns).records
    rolling = model.terrain.rolling_while_braking
    records = tuple(
        replace(r, applied=b.share_at(r.samples.window.level), resistance=rolling) for r in records
    )
    allowed = np.array([allowed_distance(b, r, quantile, rolling) for r in records])
    return Coverage(records, allowed, sessions_of(columns, runs, records), log.windows, quantile)


def sessions_of(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice], records: Sequence[StopRecord]
) -> NDArray[Any]:
    """(n,) session of each stop: the column ``session``, else the run."""
    name = "session" if "session" in columns else "run"
    if name not in columns:
        starts = np.array([run.start for run in runs])
        at = [r.samples.window.command for r in records]
        return np.searchsorted(starts, at, side="right")
    return np.array([columns[name][r.samples.window.command] for r in records])


def allowed_distance(
    braking: Braking, record: StopRecord, quantile: float, rolling: float = 0.0
) -> float:
    """Distance that a plan at a quantile allows, the worst of the states of the surface [m].

    ``rolling``: resistance that stays when the brakes are applied in part [1].
    """
    name = record.samples.terrain if record.samples.terrain in braking.terrain else ""
    width = float(ndtri(quantile))
    worst = 0.0
    for state in (name, *braking.states_of(name)):
        on = _promised(braking.on(state), record, quantile, rolling)
        coefficients = np.array(on.coefficients)
        margin = np.zeros((4, 4)) if on.covariance is None else np.array(on.covariance)
        margin = margin + on.force_scatter**2 * np.outer(coefficients, coefficients)
        margin[3, 3] += on.force_std**2
        held = record.samples.window.held_speed
        more = extra_force(on, max(held, on.speed_range[0]), record.path[1])
        distance = stopping_distance(
            held,
            on.dead_time + width * on.dead_time_std,
            record.at_level(coefficients),
            *record.path,
            (record.applied * width) ** 2 * margin,
            None if more is None else record.applied * more,
        )
        worst = max(worst, distance + on.distance_offset + record.by_effects)
    return worst


def _promised(on: Braking, record: StopRecord, quantile: float, rolling: float) -> Braking:
    """The surface with its promise at the level of the stop, the next lower of a few."""
    if on.distance is None:
        return on
    level = 1.0
    if record.applied < 1.0:
        level = max(math.floor(record.samples.window.level / _LEVEL_STEP) * _LEVEL_STEP, 0.05)
    at_level = replace(on, terrain={}, level=level)
    return promised_braking(at_level, rolling, quantile)
