"""The distance that a plan allows for a stop of a log, on the ground of the stop."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.special import ndtri

from slopewise.models.calibration.stopping import stopping_distance
from slopewise.models.calibration.uphill import extra_force
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.models.stop_promise import promised_braking

_LEVEL_STEP = 0.1
"""To which brake levels are rounded down [1]: promises are computed once for each."""


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
        on = _promised(braking.on(state) if state else braking, record, quantile, rolling)
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


def _promised(on: Braking, record: StopRecord, quantile: float, rolling: float) -> Braking:
    """The surface with its promise at the level of the stop, the next lower of a few."""
    if on.distance is None:
        return on
    level = 1.0
    if record.applied < 1.0:
        level = max(math.floor(record.samples.window.level / _LEVEL_STEP) * _LEVEL_STEP, 0.05)
    at_level = dataclasses.replace(on, terrain={}, level=level)
    return promised_braking(at_level, rolling, quantile)
