"""What each station says by itself: may the vehicle stand there, and how fast may it pass?

Passes run along rows, one lane a candidate, without branches: the compiler then works on eight
candidates at once. The laws stand in `models` with their sources; they are written out here in
sines and cosines that the terrain profile already has, and tests hold both against each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.arrays import Bools, Floats, Ints
from models.quantity import GRAVITY
from planner.ground.forces import Forces
from planner.ground.terrain_profile import TerrainRows
from planner.kernels.compiled import kernel, row_pass
from planner.kernels.limits import PlanningLimits
from planner.limiting import Limiting
from planner.swept.hazards import HazardRows

HOLDING = 0.02
"""Least F_b/W + sin θ: below it the brakes hardly hold the vehicle, let alone stop it."""

_OPEN = -1
_SPEED_LIMIT = int(Limiting.SPEED_LIMIT)
_STOPPING_PATH = int(Limiting.STOPPING_PATH)
_TIP_OVER = int(Limiting.TIP_OVER)
_ROLLOVER = int(Limiting.ROLLOVER)
_LATERAL = int(Limiting.LATERAL)
_WHEEL_SPEED = int(Limiting.WHEEL_SPEED)
_TRACTION = int(Limiting.TRACTION)
_UNKNOWN_TERRAIN = int(Limiting.UNKNOWN_TERRAIN)
_ROUGHNESS = int(Limiting.ROUGHNESS)
_MODEL_VALIDITY = int(Limiting.MODEL_VALIDITY)


class PointwiseBounds(NamedTuple):
    """What :func:`pointwise_bounds` fills in.

    Attributes, as of :class:`planner.bounds.speed_bounds.SpeedBounds`:
        speed_sq_max, limiting, accel_max, demand: (N, M).
        barrier, barrier_station: (M,).
        loads_at_risk: (M,) 1 where an axle or side may become too light during a stop.
    """

    speed_sq_max: Floats
    limiting: Ints
    accel_max: Floats
    demand: Floats
    barrier: Ints
    barrier_station: Ints
    loads_at_risk: Ints


class _PointRow(NamedTuple):
    """One row of M candidates: terrain, ground, and what the passes make of it."""

    sin_grade: Floats
    sin_roll: Floats
    curvature: Floats
    cosine: Floats
    cos_lean: Floats
    known: Bools
    trained: Bools
    slowest: Floats
    fastest: Floats
    limit: Floats
    hazard: Ints
    rough_speed: Floats
    lower_slope: Floats
    lower_intercept: Floats
    upper_slope: Floats
    upper_intercept: Floats
    barred: Ints
    speed_sq_max: Floats
    limiting: Ints
    accel_max: Floats
    demand: Floats


@kernel
def pointwise_bounds(
    terrain: TerrainRows, forces: Forces, hazards: HazardRows, speed_limit: Floats,
    limits: PlanningLimits, out: PointwiseBounds,
) -> None:  # fmt: skip
    """Bounds of each station by itself, and the first one that bars the way.

    Args:
        terrain, forces, hazards: of M candidates with up to N stations.
        speed_limit: (N, M) limits of the path itself [m/s], or (0, 0).
        limits: of the model.
        out: filled in, without any stopping path.
    """
    stations, candidates = terrain.sin_grade.shape
    cosine, cos_lean = np.empty(candidates), np.empty(candidates)
    barred = np.empty(candidates, np.int64)
    limit = np.full(candidates, np.inf)
    rough_speed, hazard = np.full(candidates, np.inf), np.zeros(candidates, np.int64)
    out.barrier[:] = _STOPPING_PATH
    out.barrier_station[:] = terrain.counts
    out.loads_at_risk[:] = 0
    for k in range(stations):
        if speed_limit.shape[0] > 0:
            limit = speed_limit[k]
        if hazards.code.shape[0] > 0:
            hazard = hazards.code[k]
        if hazards.rough_speed.shape[0] > 0:
            rough_speed = hazards.rough_speed[k]
        row = _PointRow(
            terrain.sin_grade[k], terrain.sin_roll[k], terrain.curvature[k], cosine, cos_lean,
            terrain.known[k], forces.trained[k], forces.slowest[k], forces.fastest[k], limit,
            hazard, rough_speed, forces.lower_slope[k], forces.lower_intercept[k],
            forces.upper_slope[k], forces.upper_intercept[k], barred,
            out.speed_sq_max[k], out.limiting[k], out.accel_max[k], out.demand[k],
        )  # fmt: skip
        _cosines(row)
        _drive(row, limits)
        _bars(row, limits)
        _speeds(row, limits)
        _close(k, row, out.barrier, out.barrier_station)
        _risks(k, row, limits, out.barrier_station, out.loads_at_risk)
    before, label_before = out.speed_sq_max[0].copy(), out.limiting[0].copy()
    for k in range(stations - 1):
        _between(k, out, before, label_before)


@row_pass
def _between(k: int, out: PointwiseBounds, bound_before: Floats, label_before: Ints) -> None:
    """Lower a row until v² linear to its neighbours stays below the bounds between them.

    Curvature and slopes are linear there, so a bound on v² falls like a hyperbola towards a lower
    neighbour: it stays above its tangent there. That costs second order in the spacing.
    """
    bound, label = out.speed_sq_max[k], out.limiting[k]
    bound_ahead, label_ahead = out.speed_sq_max[k + 1], out.limiting[k + 1]
    barrier_station = out.barrier_station
    for j in range(bound.shape[0]):
        here, why = bound[j], label[j]
        last, why_last = bound_before[j], label_before[j]
        following, why_following = bound_ahead[j], label_ahead[j]
        bound_before[j], label_before[j] = here, why
        tangent = last * (2.0 - last / here)
        lower = (last < here) & (tangent < here)
        least, why_least = tangent if lower else here, why_last if lower else why
        tangent = following * (2.0 - following / here)
        lower = (following < here) & (tangent < least) & (k + 1 < barrier_station[j])
        bound[j] = tangent if lower else least
        label[j] = why_following if lower else why_least


@row_pass
def _cosines(row: _PointRow) -> None:
    for j in range(row.sin_grade.shape[0]):
        row.cosine[j] = np.sqrt(1.0 - row.sin_grade[j] * row.sin_grade[j])
        row.cos_lean[j] = np.sqrt(1.0 - row.sin_roll[j] * row.sin_roll[j])


@row_pass
def _drive(row: _PointRow, limits: PlanningLimits) -> None:
    """Thrust that holds the speed, and acceleration that thrust and front axle allow."""
    per_lever = 1.0 / limits.front_lever
    for j in range(row.sin_grade.shape[0]):
        sine, upright = row.sin_grade[j], row.cosine[j] * row.cos_lean[j]
        resistance = limits.resistance + limits.turning_drag * abs(row.curvature[j])
        holding = sine + resistance * row.cosine[j]
        thrust = GRAVITY * (limits.specific_force - holding)
        lifting = GRAVITY * ((upright - limits.min_load) * per_lever - sine)
        row.accel_max[j] = max(min(limits.accel, min(thrust, lifting)), 0.0)
        row.demand[j] = holding


@row_pass
def _bars(row: _PointRow, limits: PlanningLimits) -> None:
    """Why the vehicle must not even stand there; of several reasons the last one below counts."""
    for j in range(row.sin_grade.shape[0]):
        sine, upright = row.sin_grade[j], row.cosine[j] * row.cos_lean[j]
        slow = row.slowest[j]
        fast = max(min(min(limits.speed, row.limit[j]), row.fastest[j]), slow)
        least = row.lower_intercept[j] + min(slow * row.lower_slope[j], fast * row.lower_slope[j])
        upper = row.upper_intercept[j] + slow * row.upper_slope[j]
        rear = upright + limits.rear_lever * min(sine, -upper)
        front = upright - limits.front_lever * sine
        side = upright - limits.side_lever * abs(row.cosine[j] * row.sin_roll[j])
        why = _SPEED_LIMIT if row.limit[j] <= 0.0 else _OPEN
        why = _TRACTION if row.demand[j] > limits.specific_force else why
        why = _STOPPING_PATH if least + sine < HOLDING else why
        why = _ROLLOVER if side < limits.min_load else why
        why = _TIP_OVER if min(rear, front) < limits.min_load else why
        why = why if row.hazard[j] == 0 else row.hazard[j]
        why = why if row.trained[j] else _MODEL_VALIDITY
        row.barred[j] = why if row.known[j] else _UNKNOWN_TERRAIN


@row_pass
def _speeds(row: _PointRow, limits: PlanningLimits) -> None:
    """Lowest of the speeds by limits, curvature, wheels and power; earlier names win ties."""
    for j in range(row.sin_roll.shape[0]):
        cap = min(limits.speed, row.limit[j])
        why = _MODEL_VALIDITY if row.fastest[j] < cap else _SPEED_LIMIT
        cap = min(cap, row.fastest[j])
        bound = cap * cap
        bend = abs(row.curvature[j])
        per_bend = 1.0 / bend
        turning = limits.lateral_accel * row.cos_lean[j] * per_bend if bend > 0.0 else np.inf
        why = _LATERAL if turning < bound else why
        bound = min(bound, turning)
        reach = side_reach(
            row.curvature[j], row.sin_roll[j], row.cosine[j], row.cos_lean[j], limits
        )
        rolling = reach * per_bend if bend > 0.0 else np.inf
        why = _ROLLOVER if rolling < bound else why
        bound = min(bound, rolling)
        rim = limits.max_wheel_speed / (1.0 + bend * limits.half_slip_track)
        why = _WHEEL_SPEED if rim * rim < bound else why
        bound = min(bound, rim * rim)
        sustained = limits.specific_power / row.demand[j] if row.demand[j] > 0.0 else np.inf
        why = _TRACTION if sustained * sustained < bound else why
        bound = min(bound, sustained * sustained)
        rough = row.rough_speed[j]
        why = _ROUGHNESS if rough * rough < bound else why
        row.speed_sq_max[j] = min(bound, rough * rough)
        row.limiting[j] = why


@row_pass
def side_reach(
    curvature: float, sin_roll: float, cosine: float, cos_lean: float, limits: PlanningLimits
) -> float:
    """Highest v² |κ| that keeps both sides loaded [m/s²]."""
    outward = cosine * sin_roll if curvature > 0.0 else -cosine * sin_roll
    spare = (cosine * cos_lean - limits.min_load) * (1.0 / limits.side_lever)
    return max(GRAVITY * (spare - outward), 0.0) * cos_lean


@row_pass
def _risks(
    k: int, row: _PointRow, limits: PlanningLimits, barrier_station: Ints, loads_at_risk: Ints
) -> None:
    """Could the loads run short at the highest speed that any candidate has here?"""
    for j in range(row.sin_roll.shape[0]):
        slow = row.slowest[j]
        cap = min(min(limits.speed, row.limit[j]), row.fastest[j])
        reach = side_reach(
            row.curvature[j], row.sin_roll[j], row.cosine[j], row.cos_lean[j], limits
        )
        fast = max(cap, slow)
        upper = row.upper_intercept[j] + max(slow * row.upper_slope[j], fast * row.upper_slope[j])
        rear = row.cosine[j] * row.cos_lean[j] - limits.rear_lever * upper
        risk = (reach < cap * cap * abs(row.curvature[j])) | (rear < limits.min_load)
        loads_at_risk[j] |= 1 if risk & (k < barrier_station[j]) else 0


@row_pass
def _close(k: int, row: _PointRow, barrier: Ints, barrier_station: Ints) -> None:
    """The first station that is barred closes the way for good."""
    for j in range(row.barred.shape[0]):
        why, end, first = row.barred[j], barrier[j], barrier_station[j]
        bound, label = row.speed_sq_max[j], row.limiting[j]
        accel, holding = row.accel_max[j], row.demand[j]
        before = k < first
        closes = before & (why != _OPEN)
        passed = before & (why == _OPEN)
        end = why if closes else end
        barrier[j] = end
        barrier_station[j] = k if closes else first
        row.speed_sq_max[j] = bound if passed else 0.0
        row.limiting[j] = label if passed else end
        row.accel_max[j] = accel if before else 0.0
        row.demand[j] = holding if before else 0.0
