"""What each station says by itself: may the vehicle stand there, and how fast may it pass?

Passes run along rows, one lane a candidate, without branches: the compiler then works on eight
candidates at once. The laws stand in `models` with their sources; they are written out here in
sines and cosines that the terrain profile already has, and tests hold both against each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.quantity import GRAVITY
from slopewise.planner.bounds.contact import HOLDING, ContactRow, friction_ellipse, normal_force
from slopewise.planner.ground.forces import Forces
from slopewise.planner.ground.terrain_profile import TerrainRows
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.kernels.limits import PlanningLimits
from slopewise.planner.kernels.rows import copy_row
from slopewise.planner.limiting import Limiting
from slopewise.planner.swept.hazards import HazardRows

_OPEN = -1
"""Label of a station that nothing blocks; no member of Limiting."""
_SPEED_LIMIT = int(Limiting.SPEED_LIMIT)
_STOPPING_PATH = int(Limiting.STOPPING_PATH)
_TIP_OVER = int(Limiting.TIP_OVER)
_ROLLOVER = int(Limiting.ROLLOVER)
_LATERAL = int(Limiting.LATERAL)
_WHEEL_SPEED = int(Limiting.WHEEL_SPEED)
_TRACTION = int(Limiting.TRACTION)
_UNKNOWN_TERRAIN = int(Limiting.UNKNOWN_TERRAIN)
_CREST = int(Limiting.CREST)
_FRICTION = int(Limiting.FRICTION)
_HOLDING = int(Limiting.HOLDING)
_STEERING = int(Limiting.STEERING)
_ROUGHNESS = int(Limiting.ROUGHNESS)
_MODEL_VALIDITY = int(Limiting.MODEL_VALIDITY)


LEAST_TURN = 0.1
"""Share of the lateral acceleration that any bank leaves to a turn: standing there is allowed."""


class PointwiseBounds(NamedTuple):
    """What :func:`pointwise_bounds` fills in.

    Attributes, as of :class:`slopewise.planner.bounds.speed_bounds.SpeedBounds`:
        speed_sq_max, limiting, accel_max, demand: (N, M).
        barrier, barrier_station: (M,).
        lower_slope, lower_intercept: (N, M) what friction leaves of the lower bound of F_b/W, and
            later crests.
        first_risk, last_risk: (M,) stations between which an axle, side or wheel may become too
            light during a stop; the count and -1 where none may.
    """

    speed_sq_max: Floats
    limiting: Ints
    accel_max: Floats
    demand: Floats
    barrier: Ints
    barrier_station: Ints
    lower_slope: Floats
    lower_intercept: Floats
    first_risk: Ints
    last_risk: Ints


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
    steering_speed: Floats
    vertical_curvature: Floats
    friction: Floats
    crest_sq: Floats
    friction_sq: Floats
    grip: Floats
    holds: Floats
    lower_slope: Floats
    lower_intercept: Floats
    upper_slope: Floats
    upper_intercept: Floats
    barred: Ints
    speed_sq_max: Floats
    limiting: Ints
    accel_max: Floats
    demand: Floats


class PointProblem(NamedTuple):
    """What the stations of M candidates are bounded by.

    Attributes:
        terrain, forces, hazards: of M candidates with up to N stations.
        friction: (N, M) least friction [1], or (0, 0) where it is not known.
        speed_limit: (N, M) limits of the path itself [m/s], or (0, 0).
        excess: (N, M) by how much stops may begin faster than planned [m/s], or (0, 0).
    """

    terrain: TerrainRows
    forces: Forces
    hazards: HazardRows
    friction: Floats
    speed_limit: Floats
    excess: Floats


@kernel
def pointwise_bounds(problem: PointProblem, limits: PlanningLimits, out: PointwiseBounds) -> None:
    """Bounds of each station by itself, and the first one that bars the way.

    Args:
        problem: the candidates.
        limits: of the model.
        out: filled in, without any stopping path.
    """
    terrain, forces, hazards = problem.terrain, problem.forces, problem.hazards
    stations, candidates = terrain.sin_grade.shape
    scratch = np.empty((6, candidates))
    barred = np.empty(candidates, np.int64)
    limit, friction = np.full(candidates, np.inf), np.full(candidates, np.inf)
    excess = np.zeros(candidates)
    rough_speed, hazard = np.full(candidates, np.inf), np.zeros(candidates, np.int64)
    steering_speed = np.full(candidates, np.inf)
    scratch[3], scratch[4] = np.inf, np.inf
    out.barrier[:] = _STOPPING_PATH
    copy_row(terrain.counts, out.barrier_station)
    out.first_risk[:], out.last_risk[:] = stations, -1
    slips = problem.friction.shape[0] > 0
    for k in range(stations):
        if problem.speed_limit.shape[0] > 0:
            limit = problem.speed_limit[k]
        if hazards.code.shape[0] > 0:
            hazard = hazards.code[k]
        if hazards.rough_speed.shape[0] > 0:
            rough_speed = hazards.rough_speed[k]
        if hazards.steering_speed.shape[0] > 0:
            steering_speed = hazards.steering_speed[k]
        if slips:
            friction = problem.friction[k]
        if problem.excess.shape[0] > 0:
            excess = problem.excess[k]
        row = _PointRow(
            terrain.sin_grade[k],
            terrain.sin_roll[k],
            terrain.curvature[k],
            scratch[0],
            scratch[1],
            terrain.known[k],
            forces.trained[k],
            forces.slowest[k],
            forces.fastest[k],
            limit,
            hazard,
            rough_speed,
            steering_speed,
            terrain.vertical_curvature[k],
            friction,
            scratch[2],
            scratch[3],
            scratch[4],
            scratch[5],
            out.lower_slope[k],
            out.lower_intercept[k],
            forces.upper_slope[k],
            forces.upper_intercept[k],
            barred,
            out.speed_sq_max[k],
            out.limiting[k],
            out.accel_max[k],
            out.demand[k],
        )
        _cosines(row)
        contact = ContactRow(
            row.sin_grade,
            row.sin_roll,
            row.cosine,
            row.cos_lean,
            row.curvature,
            row.vertical_curvature,
            excess,
            forces.dead_time[k],
            row.slowest,
            row.fastest,
            row.limit,
            row.friction,
            forces.lower_slope[k],
            forces.lower_intercept[k],
            row.lower_slope,
            row.lower_intercept,
            row.crest_sq,
            row.friction_sq,
            row.grip,
            row.holds,
        )
        normal_force(contact, limits)
        if slips:
            friction_ellipse(contact, limits)
        _drive(row, limits)
        _bars(row, limits)
        _speeds(row, limits)
        _close(k, row, out.barrier, out.barrier_station)
        _risks(k, row, limits, out)
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
        thrust = GRAVITY * (min(limits.specific_force, row.grip[j]) - holding)
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
        bank = row.cosine[j] * row.sin_roll[j]
        sticks = row.friction[j] * upright
        climbs = np.sqrt(max(sticks * sticks - bank * bank, 0.0))
        slips = (abs(bank) >= sticks) | (row.demand[j] > climbs)
        why = _STOPPING_PATH if least + sine < HOLDING else why
        why = _HOLDING if min(row.holds[j], climbs - limits.holding * abs(sine)) < 0.0 else why
        why = _FRICTION if slips else why
        # A wheel carries what is left of its axle's share and of its side's.
        wheel = min(rear, front) + side - upright
        why = _ROLLOVER if min(side, wheel) < limits.min_load else why
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
        felt = _lateral_reach(row.curvature[j], row.cosine[j] * row.sin_roll[j], limits)
        turning = felt * row.cos_lean[j] * per_bend if bend > 0.0 else np.inf
        why = _LATERAL if turning < bound else why
        bound = min(bound, turning)
        reach = side_reach(
            row.curvature[j],
            row.sin_roll[j],
            row.cosine[j],
            row.cos_lean[j],
            row.sin_grade[j],
            limits,
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
        bound = min(bound, rough * rough)
        steered = row.steering_speed[j]
        why = _STEERING if steered * steered < bound else why
        bound = min(bound, steered * steered)
        why = _CREST if row.crest_sq[j] < bound else why
        bound = min(bound, row.crest_sq[j])
        why = _FRICTION if row.friction_sq[j] < bound else why
        row.speed_sq_max[j] = min(bound, row.friction_sq[j])
        row.limiting[j] = why


@row_pass
def _lateral_reach(curvature: float, bank: float, limits: PlanningLimits) -> float:
    """Lateral acceleration that the limit leaves to a turn on a bank [m/s²].

    A bank that falls away from the turn is felt as well; of what it leaves, never nothing.
    """
    outward = bank if curvature > 0.0 else -bank
    felt = limits.lateral_accel - GRAVITY * max(outward, 0.0)
    return max(felt, LEAST_TURN * limits.lateral_accel)


@row_pass
def side_reach(
    curvature: float,
    sin_roll: float,
    cosine: float,
    cos_lean: float,
    sine: float,
    limits: PlanningLimits,
) -> float:
    """Highest v² |κ| that keeps both sides and every wheel loaded at a held speed [m/s²]."""
    outward = cosine * sin_roll if curvature > 0.0 else -cosine * sin_roll
    axle = min(limits.rear_lever * sine, -limits.front_lever * sine)
    spare = (cosine * cos_lean + axle - limits.min_load) * (1.0 / limits.side_lever)
    return max(GRAVITY * (spare - outward), 0.0) * cos_lean


@row_pass
def _risks(k: int, row: _PointRow, limits: PlanningLimits, out: PointwiseBounds) -> None:
    """Could the loads run short at the highest speed that any candidate has here?"""
    barrier_station, first_risk, last_risk = out.barrier_station, out.first_risk, out.last_risk
    for j in range(row.sin_roll.shape[0]):
        slow, sine = row.slowest[j], row.sin_grade[j]
        cap = min(min(limits.speed, row.limit[j]), row.fastest[j])
        fast = max(cap, slow)
        upper = row.upper_intercept[j] + max(slow * row.upper_slope[j], fast * row.upper_slope[j])
        bank = row.cosine[j] * row.sin_roll[j]
        outward = bank if row.curvature[j] > 0.0 else -bank
        lost = max(-row.vertical_curvature[j], 0.0) * cap * cap * (1.0 / GRAVITY)
        up = row.cosine[j] * row.cos_lean[j] - lost
        turn = abs(row.curvature[j]) * cap * cap / (GRAVITY * row.cos_lean[j])
        side = up - limits.side_lever * max(abs(bank), abs(outward + turn))
        axle = up + min(
            min(limits.rear_lever * sine, -limits.front_lever * sine), -limits.rear_lever * upper
        )
        risk = (min(axle, side) < limits.min_load) | (axle + side - up < limits.min_load)
        risk &= k < barrier_station[j]
        first_risk[j] = min(first_risk[j], k) if risk else first_risk[j]
        last_risk[j] = k if risk else last_risk[j]


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
