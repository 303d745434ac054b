"""What each station says by itself: may the vehicle stand there, and how fast may it pass?

Passes run along rows, one lane a candidate, without branches: the compiler then works on eight
candidates at once. The laws stand in `models` with their sources; they are written out here in
sines and cosines that the terrain profile already has, and tests hold both against each other.
"""

from __future__ import annotations

import numpy as np

from models.quantity import GRAVITY
from planner.kernels.compiled import Bools, Floats, Ints, kernel, row_pass
from planner.kernels.limits import PlanningLimits
from planner.limiting import Limiting

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
_MODEL_VALIDITY = int(Limiting.MODEL_VALIDITY)


@kernel
def pointwise_bounds(
    sin_grade: Floats, sin_roll: Floats, curvature: Floats, known: Bools, count: Ints,
    lower_slope: Floats, lower_intercept: Floats, upper_slope: Floats, upper_intercept: Floats,
    slowest: Floats, fastest: Floats, trained: Bools, speed_limit: Floats, n: PlanningLimits,
    speed_sq_max: Floats, limiting: Ints, accel_max: Floats, demand: Floats,
    barrier: Ints, barrier_station: Ints, loads_at_risk: Ints,
) -> None:  # fmt: skip
    """Bounds of each station by itself, and the first one that bars the way.

    Args:
        sin_grade, sin_roll, curvature, known: (N, M) terrain; count: (M,) stations.
        lower_slope, lower_intercept, upper_slope, upper_intercept, slowest, fastest, trained: (N,
            M) ground.
        speed_limit: (N, M) limits of the path itself [m/s], or (0, 0).
        n: the model.
        speed_sq_max, limiting, accel_max, demand, barrier, barrier_station: out, as in
            :class:`planner.bounds.speed_bounds.SpeedBounds`, without any stopping path.
        loads_at_risk: (M,) out, 1 where an axle or side may become too light during a stop.
    """
    stations, candidates = sin_grade.shape
    cosine, cos_lean = np.empty(candidates), np.empty(candidates)
    barred = np.empty(candidates, np.int64)
    limit = np.full(candidates, np.inf)
    barrier[:] = _STOPPING_PATH
    barrier_station[:] = count
    loads_at_risk[:] = 0
    for k in range(stations):
        if speed_limit.shape[0] > 0:
            limit = speed_limit[k]
        _cosines(sin_grade[k], sin_roll[k], cosine, cos_lean)
        _drive(sin_grade[k], cosine, cos_lean, curvature[k], n, accel_max[k], demand[k])
        _bars(
            sin_grade[k], sin_roll[k], cosine, cos_lean, demand[k], known[k], trained[k], limit,
            fastest[k], slowest[k], lower_slope[k], lower_intercept[k], upper_slope[k],
            upper_intercept[k], n, barred,
        )  # fmt: skip
        _speeds(
            sin_roll[k], cosine, cos_lean, curvature[k], demand[k], limit, fastest[k], n,
            speed_sq_max[k], limiting[k],
        )  # fmt: skip
        _close(
            k, barred, barrier, barrier_station,
            speed_sq_max[k], limiting[k], accel_max[k], demand[k],
        )  # fmt: skip
        _risks(
            k, sin_roll[k], cosine, cos_lean, curvature[k], limit, fastest[k], slowest[k],
            upper_slope[k], upper_intercept[k], barrier_station, n, loads_at_risk,
        )  # fmt: skip
    before, label_before = speed_sq_max[0].copy(), limiting[0].copy()
    for k in range(stations - 1):
        _between(
            k, barrier_station, speed_sq_max[k + 1], limiting[k + 1], before, label_before,
            speed_sq_max[k], limiting[k],
        )  # fmt: skip


@row_pass
def _between(
    k: int, barrier_station: Ints, bound_ahead: Floats, label_ahead: Ints,
    bound_before: Floats, label_before: Ints, bound: Floats, label: Ints,
) -> None:  # fmt: skip
    """Lower a row until v² linear to its neighbours stays below the bounds between them.

    Curvature and slopes are linear there, so a bound on v² falls like a hyperbola towards a lower
    neighbour: it stays above its tangent there. That costs second order in the spacing.
    """
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
def _cosines(sin_grade: Floats, sin_roll: Floats, cosine: Floats, cos_lean: Floats) -> None:
    for j in range(sin_grade.shape[0]):
        cosine[j] = np.sqrt(1.0 - sin_grade[j] * sin_grade[j])
        cos_lean[j] = np.sqrt(1.0 - sin_roll[j] * sin_roll[j])


@row_pass
def _drive(
    sin_grade: Floats, cosine: Floats, cos_lean: Floats, curvature: Floats, n: PlanningLimits,
    accel_max: Floats, demand: Floats,
) -> None:  # fmt: skip
    """Thrust that holds the speed, and acceleration that thrust and front axle allow."""
    per_lever = 1.0 / n.front_lever
    for j in range(sin_grade.shape[0]):
        sine, upright = sin_grade[j], cosine[j] * cos_lean[j]
        holding = sine + (n.resistance + n.turning_drag * abs(curvature[j])) * cosine[j]
        thrust = GRAVITY * (n.specific_force - holding)
        lifting = GRAVITY * ((upright - n.min_load) * per_lever - sine)
        accel_max[j] = max(min(n.accel, min(thrust, lifting)), 0.0)
        demand[j] = holding


@row_pass
def _bars(
    sin_grade: Floats, sin_roll: Floats, cosine: Floats, cos_lean: Floats, demand: Floats,
    known: Bools, trained: Bools, limit: Floats, fastest: Floats, slowest: Floats,
    lower_slope: Floats, lower_intercept: Floats, upper_slope: Floats, upper_intercept: Floats,
    n: PlanningLimits, barred: Ints,
) -> None:  # fmt: skip
    """Why the vehicle must not even stand there; of several reasons the last one below counts."""
    for j in range(sin_grade.shape[0]):
        sine, upright = sin_grade[j], cosine[j] * cos_lean[j]
        slow = slowest[j]
        fast = max(min(min(n.speed, limit[j]), fastest[j]), slow)
        least = lower_intercept[j] + min(slow * lower_slope[j], fast * lower_slope[j])
        strong = upper_intercept[j] + slow * upper_slope[j]
        rear = upright + n.rear_lever * min(sine, -strong)
        front = upright - n.front_lever * sine
        side = upright - n.side_lever * abs(cosine[j] * sin_roll[j])
        why = _SPEED_LIMIT if limit[j] <= 0.0 else _OPEN
        why = _TRACTION if demand[j] > n.specific_force else why
        why = _STOPPING_PATH if least + sine < HOLDING else why
        why = _ROLLOVER if side < n.min_load else why
        why = _TIP_OVER if min(rear, front) < n.min_load else why
        why = why if trained[j] else _MODEL_VALIDITY
        barred[j] = why if known[j] else _UNKNOWN_TERRAIN


@row_pass
def _speeds(
    sin_roll: Floats, cosine: Floats, cos_lean: Floats, curvature: Floats, demand: Floats,
    limit: Floats, fastest: Floats, n: PlanningLimits, speed_sq_max: Floats, limiting: Ints,
) -> None:  # fmt: skip
    """Lowest of the speeds by limits, curvature, wheels and power; earlier names win ties."""
    for j in range(sin_roll.shape[0]):
        cap = min(n.speed, limit[j])
        why = _MODEL_VALIDITY if fastest[j] < cap else _SPEED_LIMIT
        cap = min(cap, fastest[j])
        bound = cap * cap
        bend = abs(curvature[j])
        per_bend = 1.0 / bend
        turning = n.lateral_accel * cos_lean[j] * per_bend if bend > 0.0 else np.inf
        why = _LATERAL if turning < bound else why
        bound = min(bound, turning)
        reach = side_reach(curvature[j], sin_roll[j], cosine[j], cos_lean[j], n)
        rolling = reach * per_bend if bend > 0.0 else np.inf
        why = _ROLLOVER if rolling < bound else why
        bound = min(bound, rolling)
        rim = n.max_wheel_speed / (1.0 + bend * n.half_slip_track)
        why = _WHEEL_SPEED if rim * rim < bound else why
        bound = min(bound, rim * rim)
        sustained = n.specific_power / demand[j] if demand[j] > 0.0 else np.inf
        why = _TRACTION if sustained * sustained < bound else why
        speed_sq_max[j] = min(bound, sustained * sustained)
        limiting[j] = why


@row_pass
def side_reach(
    curvature: float, sin_roll: float, cosine: float, cos_lean: float, n: PlanningLimits
) -> float:
    """Highest v² |κ| that keeps both sides loaded [m/s²]."""
    outward = cosine * sin_roll if curvature > 0.0 else -cosine * sin_roll
    spare = (cosine * cos_lean - n.min_load) * (1.0 / n.side_lever)
    return max(GRAVITY * (spare - outward), 0.0) * cos_lean


@row_pass
def _risks(
    k: int, sin_roll: Floats, cosine: Floats, cos_lean: Floats, curvature: Floats, limit: Floats,
    fastest: Floats, slowest: Floats, upper_slope: Floats, upper_intercept: Floats,
    barrier_station: Ints, n: PlanningLimits, loads_at_risk: Ints,
) -> None:  # fmt: skip
    """Could the loads run short at the highest speed that any candidate has here?"""
    for j in range(sin_roll.shape[0]):
        slow = slowest[j]
        cap = min(min(n.speed, limit[j]), fastest[j])
        reach = side_reach(curvature[j], sin_roll[j], cosine[j], cos_lean[j], n)
        fast = max(cap, slow)
        strong = upper_intercept[j] + max(slow * upper_slope[j], fast * upper_slope[j])
        rear = cosine[j] * cos_lean[j] - n.rear_lever * strong
        risk = (reach < cap * cap * abs(curvature[j])) | (rear < n.min_load)
        loads_at_risk[j] |= 1 if risk & (k < barrier_station[j]) else 0


@row_pass
def _close(
    k: int, barred: Ints, barrier: Ints, barrier_station: Ints,
    speed_sq_max: Floats, limiting: Ints, accel_max: Floats, demand: Floats,
) -> None:  # fmt: skip
    """The first station that is barred closes the way for good."""
    for j in range(barred.shape[0]):
        why, end, first = barred[j], barrier[j], barrier_station[j]
        bound, label, accel, holding = speed_sq_max[j], limiting[j], accel_max[j], demand[j]
        before = k < first
        closes = before & (why != _OPEN)
        passed = before & (why == _OPEN)
        end = why if closes else end
        barrier[j] = end
        barrier_station[j] = k if closes else first
        speed_sq_max[j] = bound if passed else 0.0
        limiting[j] = label if passed else end
        accel_max[j] = accel if before else 0.0
        demand[j] = holding if before else 0.0
