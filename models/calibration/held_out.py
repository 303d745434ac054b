"""How a calibration predicts sessions that it has not seen.

Leaving one stop out tells how well stops of the same session are predicted; another day, another
tyre pressure or another driver shows only when whole sessions are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats, Ints
from slopewise.models.calibration.allowed_distance import allowed_distance
from slopewise.models.calibration.learn import learn
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.stop_record import StopRecord


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Stops of sessions that the prediction had not seen.

    Attributes:
        excess: (stops,) distance that plans allow for minus the actual one [m].
        distance, speed: (stops,) actual [m], at the command [m/s].
        sessions: (stops,) index of the session of each.
        unpredicted: sessions for which the others had too few stops.
    """

    excess: Floats
    distance: Floats
    speed: Floats
    sessions: Ints
    unpredicted: tuple[int, ...]

    @property
    def coverage(self) -> float:
        """Share of stops that ended within their prediction; 0 without stops."""
        return float(np.mean(self.excess >= 0.0)) if len(self.excess) else 0.0

    @property
    def mean_excess(self) -> float:
        """By how much the predictions were too long on average, of those that end [m]."""
        ends = self.excess[np.isfinite(self.excess)]
        return float(np.mean(ends)) if len(ends) else 0.0


def leave_sessions_out(
    columns: Mapping[str, NDArray[Any]],
    sessions: Sequence[Sequence[slice]],
    known: Braking,
    settings: CalibrationSettings | None = None,
) -> HeldOut:
    """Predict each session by what all others taught.

    The stops of a session are measured as they are in a calibration of the whole log.

    Args:
        columns: channels of a drive log, (n,). sessions: the runs of each. known, settings: as of
            :func:`slopewise.models.calibration.learn.learn`.

    Raises:
        ParameterError: too few usable stops in all sessions together.
    """
    quantile = (settings or CalibrationSettings()).coverage
    everything = learn(columns, [run for s in sessions for run in s], known, settings=settings)
    records = [r for surface in everything.surfaces for r in surface.records]
    excess: list[float] = []
    owners: list[int] = []
    seen: list[StopRecord] = []
    unpredicted: list[int] = []
    for index, session in enumerate(sessions):
        others = [run for s in sessions if s is not session for run in s]
        own = [
            r
            for r in records
            if any(run.start <= r.samples.window.command < run.stop for run in session)
        ]
        if not own:
            continue
        try:
            learned = learn(columns, others, known, settings=settings)
        except ParameterError:
            unpredicted.append(index)
            continue
        rolling = 0.0 if learned.levels is None else learned.levels.resistance
        excess += [
            allowed_distance(learned.braking, record, quantile, rolling) - record.samples.distance
            for record in own
        ]
        owners += [index] * len(own)
        seen += own
    return HeldOut(
        np.array(excess),
        np.array([r.samples.distance for r in seen]),
        np.array([r.samples.window.held_speed for r in seen]),
        np.array(owners, np.int64),
        tuple(unpredicted),
    )
