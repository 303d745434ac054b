"""Does a model cover the stops of a log? What plans allow for, beside where the stops ended.

Every stop that was measured counts; the model is taken as it is and learns nothing. A model covers
a log if no more stops are beyond than chance makes of the share that its quantile leaves.
Source: none; exact binomial test.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from slopewise.models.arrays import Floats
from slopewise.models.calibration.effects_in_force import measured_beside
from slopewise.models.calibration.stop_margins import normal_width
from slopewise.models.calibration.stopping import stopping_distance
from slopewise.models.calibration.uphill import extra_force
from slopewise.models.parameters import Braking, Model
from slopewise.models.stop_logs.find_stops import StopWindow
from slopewise.models.stop_logs.measured_log import measure_stops
from slopewise.models.stop_logs.stop_record import StopRecord

_CHANCE = 0.05
"""That so many stops are beyond by chance, below which a model does not cover them."""


@dataclass(frozen=True, slots=True)
class Coverage:
    """Stops of a log beside what plans allow for them, n measured stops.

    Attributes:
        records: the stops. allowed: (n,) distance that plans allow for [m], inf where they let no
            such speed. session: (n,) number of the session. windows: all stops that were found.
        quantile: of the plans.
    """

    records: tuple[StopRecord, ...]
    allowed: Floats
    session: NDArray[Any]
    windows: tuple[StopWindow, ...]
    quantile: float

    @property
    def excess(self) -> Floats:
        """(n,) allowed minus actual distance [m]."""
        result: Floats = self.allowed - np.array([r.samples.distance for r in self.records])
        return result

    def covers(self) -> bool:
        """The stops beyond are no more than chance allows, and there are stops."""
        beyond = int(np.sum(self.excess < 0.0))
        chance = stats.binom.sf(beyond - 1, len(self.records), 1.0 - self.quantile)
        return len(self.records) > 0 and float(chance) >= _CHANCE


def covered(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    model: Model,
    *,
    ground: Floats | None = None,
    quantile: float = 0.999,
) -> Coverage:
    """Hold a model against the stops of a log.

    Args:
        columns: channels of a drive log, (n,). runs: samples of each run. model: to judge.
        ground: (n,) grade of the ground from a map [rad]. quantile: of the plans.

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
        min_count=1,
    )
    records = measured_beside(log.measured, model, columns).records
    allowed = np.array([allowed_distance(b, r, quantile) for r in records])
    return Coverage(records, allowed, sessions_of(columns, runs, records), log.windows, quantile)


def allowed_distance(braking: Braking, record: StopRecord, quantile: float) -> float:
    """What a plan at a quantile allows for a stop, the worst of the states of its surface [m]."""
    name = record.samples.terrain if record.samples.terrain in braking.terrain else ""
    width = normal_width(quantile)
    worst = 0.0
    for state in (name, *braking.states_of(name)):
        on = braking.on(state) if state else braking
        own = np.array([on.m_m, on.b_m, on.m_b, on.b_b])
        margin = np.zeros((4, 4)) if on.covariance is None else np.array(on.covariance)
        margin = margin + on.force_scatter**2 * np.outer(own, own)
        margin[3, 3] += on.force_std**2
        held = record.samples.window.held_speed
        more = extra_force(on, max(held, on.speed_range[0]), record.path[1])
        distance = stopping_distance(
            held,
            on.dead_time + width * on.dead_time_std,
            record.at_level(own),
            *record.path,
            (record.applied * width) ** 2 * margin,
            None if more is None else record.applied * more,
        )
        worst = max(worst, distance + on.distance_offset + record.by_effects)
    return worst


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
