"""Separate slope coefficients uphill, fitted where the stops support them.

    F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b) + k max(θ, 0)

The braking model has one slope coefficient for both directions; a different one uphill would appear
as scatter. Where k is significant its force is subtracted from each stop before the four
coefficients are fitted, and b_m + k applies uphill. The change of stopping distance by k on varying
grades is recorded as the distance of a named effect is.
Source: Braking Sec. 2, which names separate coefficients for uphill and downhill.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import WEAK_PRIOR
from slopewise.models.calibration.stopping import stopping_distance
from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.models.effects import registry
from slopewise.models.force_design import design
from slopewise.models.parameters import Braking, Model
from slopewise.models.stop_logs import random_effects
from slopewise.models.stop_logs.measure import Measured
from slopewise.models.stop_logs.stop_record import StopRecord, forces_of

_MIN_STOPS = 8  # minimum number of stops uphill and downhill
_STEEP = 0.035  # [rad] lowest grade that is uphill or downhill
_PRIOR = 1.0  # [1/rad] much wider than any asymmetry of real brakes
_SIGNIFICANT = 3.5  # standard deviations


@dataclass(frozen=True, slots=True)
class Asymmetry:
    """Change k of the slope coefficient uphill, and its standard deviation [1/rad]."""

    value: float
    std: float

    @property
    def clear(self) -> bool:
        """Whether the change is significant."""
        return abs(self.value) > _SIGNIFICANT * self.std


def clear_asymmetry(base: SurfaceFit, effects_model: Model | None) -> Asymmetry | None:
    """Significant change of the slope coefficient uphill that no effect of the model explains."""
    effects = () if effects_model is None else effects_model.effect
    laws = [registry.LAWS[effect.name] for effect in effects]
    if any(law.kinks_at_level and law.axis == "grade" for law in laws):
        return None
    inliers = [r for r in base.records if r.kept]
    uphill = asymmetry(*forces_of(inliers))
    return uphill if uphill is not None and uphill.clear else None


def asymmetry(speed: Floats, grade: Floats, force_ratio: Floats, noise: Floats) -> Asymmetry | None:
    """Asymmetry of stops; None with too few uphill or downhill.

    Args:
        speed: (n,) onset speeds [m/s]. grade: (n,) mean θ while braking [rad].
        force_ratio: (n,) gravity-free F_b/W. noise: (n,) its measurement noise.
    """
    if min(int((grade > _STEEP).sum()), int((grade < -_STEEP).sum())) < _MIN_STOPS:
        return None
    x = np.column_stack((design(speed, grade), np.maximum(grade, 0.0)))
    fit = random_effects.fit(
        x, force_ratio, noise, np.zeros(5), np.diag(np.square((*WEAK_PRIOR, _PRIOR)))
    )
    return Asymmetry(float(fit.coefficients[4]), float(np.sqrt(fit.covariance[4, 4])))


def net_of_uphill(measured: Measured, change: float, known: Braking) -> Measured:
    """Stops with the extra uphill force removed.

    Args:
        measured: stops at full brakes. change: k [1]. known: prior braking; its slope
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
    level_law = np.array([0.0, slope, 0.0, force - slope * record.grade])
    held = record.samples.window.held_speed
    plain = stopping_distance(held, dead, level_law, station, grade)
    uphill = stopping_distance(
        held, dead, level_law, station, grade, extra=change * np.maximum(grade, 0.0)
    )
    longer = uphill - plain
    return dataclasses.replace(
        record,
        force_ratio=force,
        by_effects=record.by_effects + (longer if math.isfinite(longer) else 0.0),
    )


def extra_force(on: Braking, speed: float, grade: Floats) -> Floats | None:
    """Force F_b/W that uphill coefficients add, (n,); None if the surface has none.

    Args:
        on: braking model of a surface. speed: onset speed [m/s]. grade: θ [rad], (n,).
    """
    if on.uphill is None:
        return None
    change = (on.uphill.m_m - on.m_m) * speed + on.uphill.b_m - on.b_m
    return change * np.maximum(grade, 0.0)
