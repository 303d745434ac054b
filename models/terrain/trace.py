"""States of the slip track filter along one run, sample by sample, for pages.

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

_PAUSE = 0.5
"""Time without the filter that ends a turn [s]."""


@dataclass(frozen=True, slots=True)
class TerrainTrace:
    """One run; arrays are (n,), NaN where there is nothing to show."""

    time: Floats  # [s]
    speed_difference: Floats  # ΔV [m/s]
    yaw_rate: Floats  # ω_z with bias [rad/s]
    current_left: Floats  # [A]
    current_right: Floats
    slip_track: Floats  # B_s of the filter [m], NaN before it first ran
    slip_track_std: Floats
    active: Bools  # the filter ran at this sample
    stuck: Bools
    predicted_variance: Floats  # of 1/B_s before each sample of the first turn [1/m²]
    settled_variance: float  # by the Riccati equation [1/m²]; NaN without a turn


def trace(
    estimator: TerrainEstimator, rows: Iterable[tuple[DriveSample, bool]], settings: FilterSettings
) -> TerrainTrace:
    """Send a run through a new estimator, as arguments of its update, and record its states."""
    states: list[tuple[float, ...]] = []
    ran = False
    for sample, usable in rows:
        before = estimator.filter.variance
        estimator.update(sample, usable)
        is_active = estimator.filter.variance != before
        ran = ran or is_active
        track = estimator.filter if ran else None
        slip = (math.nan, math.nan) if track is None else (track.slip_track, track.slip_track_std)
        is_stuck = estimator.phases.phase is Phase.STUCK
        driven = (sample.time, sample.v_right - sample.v_left, *sample[3:6])
        states.append((*driven, *slip, is_active, is_stuck, estimator.filter.variance))
    columns = np.array(states, np.float64).reshape(-1, 10).T
    active, stuck = columns[7] > 0.5, columns[8] > 0.5
    variances, settled = _first_turn(columns, active, settings)
    time, dv, w, left, right, b_s, std = columns[:7]
    return TerrainTrace(time, dv, w, left, right, b_s, std, active, stuck, variances, settled)


def _first_turn(columns: Floats, active: Bools, settings: FilterSettings) -> tuple[Floats, float]:
    """Variances before the samples of the first turn, and where they settle at its ΔV."""
    running = np.flatnonzero(active)
    if len(running) < 2:
        return np.empty(0), math.nan
    pauses = np.flatnonzero(np.diff(columns[0][running]) > _PAUSE)
    turn = running[: int(pauses[0]) + 1] if len(pauses) else running
    step = float(np.median(np.diff(columns[0][turn]))) if len(turn) > 1 else settings.sample_time
    growth = settings.process_variance / settings.sample_time * step
    after = np.concatenate(([settings.initial_std**2], columns[9][turn][:-1]))
    here = dataclasses.replace(settings, process_variance=growth, sample_time=step)
    difference = float(np.sqrt(np.mean(columns[1][turn] ** 2)))
    return after + growth, steady_state_variance(difference, here)[0]
