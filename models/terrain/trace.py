"""How the slip track filter went through one run, sample by sample, to be looked at.

Source: Slip, Figs. 7 and 8.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.terrain.estimator import DriveSample, TerrainEstimator
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.settings import FilterSettings
from slopewise.models.terrain.slip_track_filter import steady_state_variance

_APART = 0.5  # [s] without the filter ends a turn


@dataclass(frozen=True, slots=True)
class TerrainTrace:
    """One run; arrays are (n,), NaN where there is nothing to show.

    Attributes:
        time: [s]. speed_difference: ΔV [m/s]. yaw_rate: ω_z as measured [rad/s].
        current_left, current_right: [A].
        slip_track, slip_track_std: B_s [m] as the filter has it, NaN before it first ran.
        active: the filter ran at this sample.
        stuck: the vehicle was stuck.
        predicted_variance: of 1/B_s before each sample of the first turn [1/m²].
        settled_variance: where the Riccati equation says it settles; NaN without a turn.
    """

    time: Floats
    speed_difference: Floats
    yaw_rate: Floats
    current_left: Floats
    current_right: Floats
    slip_track: Floats
    slip_track_std: Floats
    active: Bools
    stuck: Bools
    predicted_variance: Floats
    settled_variance: float


def trace(
    estimator: TerrainEstimator,
    rows: Iterable[tuple[DriveSample, bool]],
    settings: FilterSettings,
) -> TerrainTrace:
    """Send a run through an estimator and record its states.

    Args:
        estimator: fresh, or at the beginning of a run.
        rows: arguments of :meth:`TerrainMonitor.update`.
        settings: those of its filter.
    """
    kept: list[tuple[float, ...]] = []
    ran = False
    for sample, usable in rows:
        before = estimator.filter.variance
        estimator.update(sample, usable)
        active = estimator.filter.variance != before
        ran = ran or active
        b_s = estimator.filter.slip_track if ran else math.nan
        std = estimator.filter.slip_track_std if ran else math.nan
        stuck = estimator.phases.phase is Phase.STUCK
        kept.append(
            (
                sample.time,
                sample.v_right - sample.v_left,
                *sample[3:6],
                b_s,
                std,
                active,
                stuck,
                estimator.filter.variance,
            )
        )
    columns = np.array(kept, np.float64).reshape(-1, 10).T
    variances, settled = _first_turn(columns, columns[7] > 0.5, settings)
    return TerrainTrace(
        time=columns[0],
        speed_difference=columns[1],
        yaw_rate=columns[2],
        current_left=columns[3],
        current_right=columns[4],
        slip_track=columns[5],
        slip_track_std=columns[6],
        active=columns[7] > 0.5,
        stuck=columns[8] > 0.5,
        predicted_variance=variances,
        settled_variance=settled,
    )


def _first_turn(columns: Floats, active: Bools, settings: FilterSettings) -> tuple[Floats, float]:
    """Variances before the samples of the first turn, and where they settle at its ΔV."""
    running = np.flatnonzero(active)
    if len(running) < 2:
        return np.empty(0), math.nan
    apart = np.flatnonzero(np.diff(columns[0][running]) > _APART)
    turn = running[: int(apart[0]) + 1] if len(apart) else running
    step = float(np.median(np.diff(columns[0][turn]))) if len(turn) > 1 else settings.sample_time
    growth = settings.process_variance / settings.sample_time * step
    after = np.concatenate(([settings.initial_std**2], columns[9][turn][:-1]))
    here = dataclasses.replace(settings, process_variance=growth, sample_time=step)
    difference = float(np.sqrt(np.mean(columns[1][turn] ** 2)))
    return after + growth, steady_state_variance(difference, here)[0]
