"""Slope coefficients of their own uphill, fitted where the stops carry them.

    F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b) + k max(θ, 0)

k is taken out of the stops, which then teach the four coefficients; uphill b_m + k holds. What k
does to the length of a stop on slopes that vary is kept beside, as that of a named effect is.
Source: Braking Sec. 2, which names coefficients for both ways as an extension.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.stopping import stopping_distance
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.measure import Measured
from slopewise.models.stop_logs.stop_record import StopRecord


def beside_uphill(measured: Measured, change: float, known: Braking) -> Measured:
    """The stops with what is left of their force once uphill has its own slope coefficient.

    Args:
        measured: stops at full brakes. change: k [1]. known: braking so far; its slope
            coefficients matter where the grade varies along a stop.
    """
    dead = measured.dead_time.value
    records = tuple(_without(r, change, dead, known) for r in measured.records)
    return dataclasses.replace(measured, records=records, bounds=())


def _without(record: StopRecord, change: float, dead: float, known: Braking) -> StopRecord:
    station, grade = record.path
    force = record.force_ratio - change * max(record.grade, 0.0)
    if not (grade > 0.0).any():
        return dataclasses.replace(record, force_ratio=force)
    slope = known.m_m * record.onset_speed + known.b_m
    own = np.array([0.0, slope, 0.0, force - slope * record.grade])
    held = record.samples.window.held_speed
    plain = stopping_distance(held, dead, own, station, grade)
    uphill = stopping_distance(
        held, dead, own, station, grade, extra=change * np.maximum(grade, 0.0)
    )
    longer = uphill - plain
    return dataclasses.replace(
        record,
        force_ratio=force,
        by_effects=record.by_effects + (longer if math.isfinite(longer) else 0.0),
    )


def extra_force(on: Braking, speed: float, grade: Floats) -> Floats | None:
    """(n,) force that coefficients uphill add to those of the model, on grades (n,); None without.

    Args:
        on: braking model of a surface. speed: at onset [m/s].
    """
    if on.uphill is None:
        return None
    change = (on.uphill.m_m - on.m_m) * speed + on.uphill.b_m - on.b_m
    result: Floats = change * np.maximum(grade, 0.0)
    return result
