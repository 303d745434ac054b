"""How the force grows with brake application: dead band, slope, saturation.

    F = r + g(u) (F_full − r),   g(u) = (u − d) / (s − d) held within 0 … 1

with the application u, the rolling resistance r of released brakes, the dead band d and the
saturation s. One fit of these and of the four coefficients of F_full uses the stops at every
application, each weighted by its share.

Validity: constant application during the stop. Source: Braking (6) has r and one straight line.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import WEAK_PRIOR
from slopewise.models.force_design import design
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.measure import Measured
from slopewise.models.stop_logs.stop_record import forces_of

_MIN_STOPS = 6
"""Minimum number of partial stops for a fit [1]."""

_PART = 0.98  # [1] application from which a stop is at full brakes, unless saturated earlier
_SPREAD = 0.1  # [1] minimum range of the applications: below it the slope is undetermined
_SCATTER = 0.02  # [1] of F_b/W, added to the measurement noise
_RESISTANCE_STD = 0.03  # [1] prior of the rolling resistance
_LINE_STD = 0.5  # [1] weak prior of dead band and saturation
_MIN_SHARE = 0.03  # [1] lowest share that a force is divided by
_MAX_BAND, _MIN_WIDTH = 0.6, 0.15
"""Largest dead band and smallest width from band to full braking, shares of the brake command [1]:
beyond them a log has too few levels to identify both."""


@dataclass(frozen=True, slots=True)
class BrakeLevels:
    """Dead band, slope and saturation of the brakes.

    Attributes:
        dead_band, saturation: application d, s [1]. resistance: r [1].
        std: standard deviations of d, s and r [1]. stops: number of partial stops.
    """

    dead_band: float
    saturation: float
    resistance: float
    std: tuple[float, float, float]
    stops: int

    def share(self, level: Floats) -> Floats:
        """g(u) of applications (n,)."""
        return _share(level, self.dead_band, self.saturation)


def _share(level: Floats, dead_band: float, saturation: float) -> Floats:
    return np.clip((level - dead_band) / (saturation - dead_band), 0.0, 1.0)


def _levels(measured: Measured) -> Floats:
    return np.array([r.samples.window.level for r in measured.records])


def identifies_levels(measured: Measured) -> bool:
    """Whether number and range of partial stops suffice for a fit."""
    level = _levels(measured)
    return (
        int((level < _PART).sum()) >= _MIN_STOPS and float(np.ptp(level)) >= _SPREAD - 1e-9
    )  # 0.6 - 0.5 < 0.1


def at_full_level(
    measured: Measured, known: Braking, resistance: float
) -> tuple[Measured, BrakeLevels | None]:
    """Stops with their force scaled to full brakes, and the law; None with too few partial stops.

    Args:
        measured: stops. known: prior braking. resistance: prior rolling resistance [1].
    """
    if not identifies_levels(measured):
        return measured, None
    level = _levels(measured)
    curve = _fit(measured, level, known, resistance)
    share = np.maximum(curve.share(level), _MIN_SHARE)
    _, _, force, noise = forces_of(measured.records)
    full = curve.resistance + (force - curve.resistance) / share
    missing, width = full - curve.resistance, curve.saturation - curve.dead_band
    band, saturation, rolling = curve.std
    line = np.hypot(band * (1.0 - share) / width, saturation * share / width) * missing / share
    line = np.where(share < 1.0, line, 0.0)
    noise = np.sqrt((noise / share) ** 2 + line**2 + (rolling * (1.0 / share - 1.0)) ** 2)
    braked = level > curve.dead_band + 1e-9
    full = np.where(braked, full, [known.level_force(r.onset_speed) for r in measured.records])
    columns = (full.tolist(), np.where(braked, noise, 1.0).tolist(), share.tolist())
    records = tuple(
        dataclasses.replace(r, force_ratio=f, force_std=s, applied=g, resistance=curve.resistance)
        for r, f, s, g in zip(measured.records, *columns, strict=True)
    )
    return dataclasses.replace(measured, records=records), curve


def _fit(measured: Measured, level: Floats, known: Braking, resistance: float) -> BrakeLevels:
    speed, grade, force, noise = forces_of(measured.records)
    x = design(speed, grade)
    width = np.hypot(noise, _SCATTER)
    prior = np.array([*known.coefficients, 0.0, 1.0, resistance])
    std = np.array([*WEAK_PRIOR, _LINE_STD, _LINE_STD, _RESISTANCE_STD])

    def residual(p: Floats) -> Floats:
        share = _share(level, p[4], max(p[5], p[4] + _MIN_WIDTH))
        return np.concatenate(
            ((force - p[6] - share * (x @ p[:4] - p[6])) / width, (p - prior) / std)
        )

    low = [-np.inf] * 4 + [0.0, _MIN_WIDTH, 0.0]
    high = [np.inf] * 4 + [_MAX_BAND, 1.0, 0.3]
    best = None
    for band, full in ((0.02, 0.98), (0.1, 0.8), (0.25, 0.6)):
        start = np.concatenate((prior[:4], (band, full, np.clip(resistance, 1e-3, 0.29))))
        solution = least_squares(residual, start, bounds=(low, high), loss="soft_l1", x_scale=std)
        if best is None or solution.cost < best.cost:
            best = solution
    assert best is not None
    covariance = np.linalg.pinv(best.jac.T @ best.jac)
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))[4:]
    band, full, rolling = (float(v) for v in best.x[4:])
    return BrakeLevels(
        band,
        max(full, band + _MIN_WIDTH),
        rolling,
        (float(spread[0]), float(spread[1]), float(spread[2])),
        int((level < _PART).sum()),
    )
