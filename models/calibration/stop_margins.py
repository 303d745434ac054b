"""From the residuals of stops to the margins of a model file: force, dead time, and what is left.

1. Force. Residuals of F_b/W of stops that the fit had not seen; whether they grow with the force
   or not the stops say themselves (likelihood). :mod:`.scatter` makes of them the scatter to plan
   with.
2. Dead time. Likewise the onsets, a late one being the dangerous one.
3. What is left. With its own force and its own onset a stop ends where it ended but for map, clock
   and standstill. That is the constant: what is missing to cover it beside the margins of force and
   dead time, and whatever more stops of the log than the quantile leaves went beyond all of these.

Plans take force and dead time at the quantile each and add them up, which is longer than both
together by up to the root of two. A stop counts in one of the three only.

Source: Braking (11), (12) name the offset and leave its value open.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import ForceFit, design
from slopewise.models.calibration.scatter import Scatter, scatter_of
from slopewise.models.calibration.stopping import stopping_distance
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.dead_time import DeadTime
from slopewise.models.stop_logs.stop_record import StopRecord

_LEAST_PULL = 0.02  # [1] of the weight, net of gravity
_LEAST_FORCE = 0.02  # [1] below which a share of the force says nothing


class ForceScatter(NamedTuple):
    """Scatter of F_b/W to plan with; one of the two is 0.

    Attributes:
        absolute: [1]. relative: share of the force [1]. law: of the residuals, in the unit of the
            one that is not 0.
    """

    absolute: float
    relative: float
    law: Scatter

    def std(self, force: Floats) -> Floats:
        """(n,) standard deviation to plan with, at forces (n,)."""
        result: Floats = np.hypot(self.absolute, self.relative * np.abs(force))
        return result


class Margins(NamedTuple):
    """What plans at a quantile give up.

    Attributes:
        force: scatter. dead_time: standard deviation [s], of its scatter and of its value.
        covariance: (4, 4) of the coefficients.
    """

    force: ForceScatter
    dead_time: float
    covariance: Floats

    def matrix(self, coefficients: Floats, width: float) -> Floats:
        """(4, 4) matrix S: plans at so many standard deviations give up √(φᵀ S φ) of F_b/W."""
        total = self.covariance + self.force.relative**2 * np.outer(coefficients, coefficients)
        total[3, 3] += self.force.absolute**2
        result: Floats = width**2 * total
        return result


def unseen_residuals(fit: ForceFit, records: Sequence[StopRecord]) -> tuple[Floats, Floats]:
    """Residuals of F_b/W (n,) as of stops that the fit had not seen, and the forces predicted (n,).

    A residual that the fit has seen is smaller by √(1 − leverage); one that it left out is whole.
    """
    speed, grade = (np.array([getattr(r, n) for r in records]) for n in ("onset_speed", "grade"))
    x = design(speed, grade)
    leverage = np.clip(np.einsum("ni,in->n", x, fit.regression.gain), 0.0, 0.95)
    predicted = x @ fit.coefficients
    measured = np.array([r.force_ratio for r in records])
    return (measured - predicted) / np.sqrt(1.0 - leverage), predicted


def force_scatter(residual: Floats, noise: Floats, force: Floats) -> ForceScatter:
    """Scatter of the force, in proportion to it or not, whichever the stops make likelier.

    Args:
        residual: (n,) of F_b/W. noise: (n,) of it. force: (n,) predicted.
    """
    size = np.maximum(force, _LEAST_FORCE)
    spread = 1.4826 * float(np.median(np.abs(residual)))
    usual = np.abs(residual) <= 4.0 * np.hypot(spread, noise)
    even = float(np.log(np.std(residual[usual]) + 1e-12)) * int(usual.sum())
    shared = float(np.log(np.std((residual / size)[usual]) + 1e-12)) * int(usual.sum())
    shared += float(np.sum(np.log(size[usual])))
    if shared < even:
        law = scatter_of(residual / size, noise / size)
        return ForceScatter(0.0, law.planned, law)
    law = scatter_of(residual, noise)
    return ForceScatter(law.planned, 0.0, law)


def dead_time_scatter(records: Sequence[StopRecord], dead_time: DeadTime) -> Scatter:
    """Scatter of the dead time [s] behind the onsets of stops."""
    late = np.array([r.knee.onset_time - r.onset_shift for r in records]) - dead_time.value
    noise = [r.noise * np.sqrt(r.knee.covariance[1, 1]) for r in records]
    return scatter_of(-late, np.array(noise))


def bounds(
    records: Sequence[StopRecord],
    coefficients: Floats,
    dead_time: float,
    margins: Margins,
    width: float,
) -> Floats:
    """(n,) distances at ``width`` standard deviations, without the constant [m]; inf if endless.

    Args:
        records: n stops. coefficients: (n, 4) by fits that have not seen their stop.
        dead_time: [s].
    """
    late = dead_time + width * margins.dead_time
    return np.array(
        [
            stopping_distance(
                r.samples.window.held_speed,
                late,
                r.at_level(c),
                *r.path,
                r.applied**2 * margins.matrix(c, width),
            )
            + r.by_effects
            for r, c in zip(records, coefficients, strict=True)
        ]
    )


class MeasuredStops(NamedTuple):
    """Columns of stops, (n,) each.

    Attributes:
        speed: at onset [m/s]. grade: [rad]. force: F_b/W as measured.
        left: distance beyond that of the stop's own force and onset [m].
        over: distance beyond the bound of force and dead time [m], below 0 if within.
    """

    speed: Floats
    grade: Floats
    force: Floats
    left: Floats
    over: Floats


def what_is_left(stops: MeasuredStops, margins: Margins, width: float) -> float:
    """The constant beside the margins of force and dead time [m], at least 0.

    Args:
        stops: all that are measured well. width: standard deviations of the quantile.
    """
    known = np.isfinite(stops.left)
    if not known.any():
        return 0.0
    pull = np.maximum(stops.force + np.sin(stops.grade), _LEAST_PULL)
    by_force = margins.force.std(stops.force) * stops.speed**2 / (2.0 * GRAVITY * pull**2)
    by_delay = margins.dead_time * stops.speed
    scatter = float(np.std(stops.left[known]))
    together = np.sqrt(by_force**2 + by_delay**2 + scatter**2)
    missing = float(np.mean(stops.left[known])) + width * (together - by_force - by_delay)
    # So many stops of the log may be beyond at this quantile.
    beyond = int((1.0 - stats.norm.cdf(width)) * (len(stops.over) + 1))
    over = np.sort(np.where(np.isfinite(stops.over), stops.over, 0.0))[-1 - beyond]
    return max(0.0, float(over), float(np.max(missing)))


def own_distance(record: StopRecord, slope: float) -> float:
    """From command to standstill with the force and the onset that the stop itself shows [m].

    Args:
        record: the stop. slope: change of F_b/W with grade at its speed [1/rad].
    """
    knee = record.knee
    own = np.array([0.0, slope, 0.0, knee.force_ratio - slope * knee.mean_grade])
    return stopping_distance(
        record.samples.window.held_speed, max(knee.onset_time, 0.0), own, *record.path
    )


def normal_width(quantile: float) -> float:
    """Standard deviations that a one-sided quantile is away from the mean."""
    return float(stats.norm.ppf(quantile))
