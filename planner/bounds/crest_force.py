"""What crests take from the braking force of a stop that ends before the clear distance.

The loss grows with v². Of all stops that end in time none is faster at a station than what the
brakes could take out from there to the target, were no load lost; nor than the station's own bound
by more than a plan slows down during a dead time. Up to that speed the force that is left is known
without following any stop. A stop that is faster there does not end in time with
this force, and all the less with its own.

Law: :mod:`slopewise.models.laws.crest`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects.registry import MotionTerms
from slopewise.models.quantity import GRAVITY
from slopewise.planner.bounds.pointwise import PointwiseBounds
from slopewise.planner.bounds.stopping_path import StopProblem
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.kernels.limits import PlanningLimits

_SURELY = 1.0 + 1e-3
"""More than what the sum of a sine between two stations leaves out."""


class _CrestRow(NamedTuple):
    """One row of M candidates and the station of the next; the force is lowered in place."""

    station: Floats
    ahead: Floats
    sin_grade: Floats
    sin_roll: Floats
    vertical_curvature: Floats
    dead_time: Floats
    speed_sq_max: Floats
    slowest: Floats
    lower_slope: Floats
    lower_intercept: Floats


@kernel
def lose_on_crests(
    problem: StopProblem,
    fastest: float,
    limits: PlanningLimits,
    motion: MotionTerms,
    bounds: PointwiseBounds,
) -> None:
    """Lower ``bounds.lower_slope`` and ``bounds.lower_intercept`` to what crests leave of them.

    Args:
        problem: terrain and targets of M candidates; its forces are not read.
        fastest: no stop is faster [m/s].
        limits: of the model.
        motion: where effects move the vehicle every station may be met at ``fastest``; where the
            force lags, what a crest takes anywhere is missing everywhere, for a force that has
            built up before it does not wait to be lost on it.
        bounds: v² with what a stop may begin faster than planned; its force is lowered.
    """
    terrain, forces = problem.terrain, problem.forces
    stations, candidates = terrain.station.shape
    taken_out = np.full(candidates, np.inf if motion.moves else 0.0)
    least = np.ones(candidates)
    force_ahead = np.zeros(candidates)
    for k in range(stations - 1, -1, -1):
        after = min(k + 1, stations - 1)
        row = _CrestRow(
            terrain.station[k],
            terrain.station[after],
            terrain.sin_grade[k],
            terrain.sin_roll[k],
            terrain.vertical_curvature[k],
            forces.dead_time[k],
            bounds.speed_sq_max[k],
            forces.slowest[k],
            bounds.lower_slope[k],
            bounds.lower_intercept[k],
        )
        _lose(row, problem.target, fastest, limits, (taken_out, force_ahead, least))
    if motion.lag > 0.0:
        for k in range(stations):
            for j in range(candidates):
                bounds.lower_slope[k, j] *= least[j]
                bounds.lower_intercept[k, j] *= least[j]


@row_pass
def _lose(
    row: _CrestRow,
    target: Floats,
    fastest: float,
    limits: PlanningLimits,
    carried: tuple[Floats, Floats, Floats],
) -> None:
    """One row; carried on are what the brakes take out from it to the target, over m g [m], its
    force and slope, and the least share that any station keeps.
    """
    taken_out, force_ahead, least = carried[0], carried[1], carried[2]
    for j in range(target.shape[0]):
        sine, slow = row.sin_grade[j], row.slowest[j]
        up = np.sqrt((1.0 - sine * sine) * (1.0 - row.sin_roll[j] * row.sin_roll[j]))
        slope, intercept = row.lower_slope[j], row.lower_intercept[j]
        length = max(min(row.ahead[j], target[j]) - row.station[j], 0.0)
        part = max(slow * slope, max(fastest, slow) * slope)
        most = max(part + intercept + sine, force_ahead[j])
        energy = 2.0 * GRAVITY * (taken_out[j] + length * max(most, 0.0)) * _SURELY
        reached = np.sqrt(max(row.speed_sq_max[j], 0.0)) + limits.decel * row.dead_time[j]
        reached = min(reached, fastest)
        speed_sq = min(reached * reached, energy)
        falls = max(-row.vertical_curvature[j], 0.0)
        kept = 1.0 - limits.crest_share * falls * speed_sq / (GRAVITY * up)
        kept = max(kept, 0.0)
        kept = kept if intercept + min(slow * slope, fastest * slope) > 0.0 else 1.0
        row.lower_slope[j] = slope * kept
        row.lower_intercept[j] = intercept * kept
        least[j] = min(least[j], kept if length > 0.0 else 1.0)
        here = kept * (part + intercept) + sine
        taken_out[j] = max(taken_out[j] + 0.5 * length * (here + force_ahead[j]), 0.0)
        force_ahead[j] = here
