"""The judge of a finished plan: is every constraint kept, at the stations and between them?

It shares no approximation with what made the plan: bounds work with tangents and chords of v² and
with sums of sines, the judge follows every emergency stop to its end, on the laws of `models`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models.effects import registry
from models.effects.registry import MotionTerms
from models.laws import slip_track
from models.parameters import Model
from models.quantity import GRAVITY
from planner.kernels.compiled import Bools, Floats, Ints, inlined, kernel
from planner.kernels.limits import PlanningLimits, planning_limits
from planner.kernels.motion_laws import motion_deceleration
from planner.limiting import Limiting
from planner.verify.stop_by_energy import ends_before, loads_by_energy, stop_by_energy, work_up_to
from planner.verify.stop_in_time import stop_in_time
from planner.verify.track import Body, Survey, Track, at, body_of, segment, survey_of

TIME_STEP = 0.02
"""Step of the integrator in time [s]; halving it moves a stop by less than 10 µm."""

BETWEEN = 3
"""Points inside each segment from which a stop is tried as well."""

_TOLERANCE = 1e-6
_OVERRUN, _AXLE, _SIDE, _SPEED, _LATERAL, _WHEEL, _ACCEL, _DECEL = range(8)
_rim_ratio = inlined(slip_track.outer_wheel_speed_ratio)


class Violations(NamedTuple):
    """The worst breach of one kind: by how much, in the unit of what is breached; 0 is none."""

    overrun: float
    axle_load: float
    side_load: float
    speed: float
    lateral: float
    wheel_speed: float
    accel: float
    decel: float


@dataclass(frozen=True, slots=True)
class Judgement:
    """What the judge found.

    Attributes:
        stop_distance: (N,) emergency stop from each station at its speed, with its safety offset;
            0 where the plan stands [m].
        rear_load: (N,) least rear axle load on that stop, as share of its level static load.
        side_load: (N,) least side load on that stop, as share of half the weight.
        violation: the worst breaches, all 0 for a valid plan.
        where: (N − 1,) segments in or at the start of which something is breached.
    """

    stop_distance: Floats
    rear_load: Floats
    side_load: Floats
    violation: Violations
    where: Ints

    @property
    def valid(self) -> bool:
        """No constraint is breached."""
        return max(self.violation) <= 0.0


def check(
    track: Track,
    speed_sq: Floats,
    clear_distance: float,
    distance_offset: float,
    motion: MotionTerms,
    model: Model,
    *,
    decel: float | None = None,
    between: int = BETWEEN,
    time_step: float = TIME_STEP,
) -> Judgement:
    """Judge one plan.

    Args:
        track: the candidate.
        speed_sq: (N,) v², linear between stations [m²/s²].
        clear_distance: station before which every stop must end [m].
        distance_offset: safety offset of the model [m].
        motion: effects on the motion.
        model: vehicle and limits.
        decel: planned deceleration allowed, inf for an emergency; that of the model if left out.
        between: points inside each segment to try as well.
        time_step: of the integrator [s].
    """
    n = len(speed_sq)
    stop_distance, rear_load, side_load = np.empty((3, n))
    worst = np.zeros(len(Violations._fields))
    bad = np.zeros(max(n - 1, 1), np.bool_)
    scalars = planning_limits(model)
    if decel is not None:
        scalars = scalars._replace(decel=decel)
    in_time = motion != registry.NO_MOTION._replace(heat=motion.heat)
    _check(
        track, body_of(model), scalars, motion, in_time, speed_sq, clear_distance,
        distance_offset, between, time_step, stop_distance, rear_load, side_load, worst, bad,
    )  # fmt: skip
    violation = Violations(*(float(w) for w in worst))
    return Judgement(stop_distance, rear_load, side_load, violation, np.flatnonzero(bad))


@inlined
def _breaks(worst: Floats, kind: int, breach: float) -> bool:
    """Note a breach; what is not a number is one as well."""
    if breach <= _TOLERANCE:
        return False
    worst[kind] = max(worst[kind], breach if np.isfinite(breach) else np.inf)
    return True


@kernel
def _check(
    track: Track, body: Body, n: PlanningLimits, motion: MotionTerms, in_time: bool,
    speed_sq: Floats, clear_distance: float, distance_offset: float, between: int, h: float,
    stop_distance: Floats, rear_load: Floats, side_load: Floats, worst: Floats, bad: Bools,
) -> None:  # fmt: skip
    survey = survey_of(track, body, np.empty((8, speed_sq.shape[0])))
    judge_track(
        track, body, n, motion, in_time, speed_sq, clear_distance, distance_offset, between, h,
        True, survey, stop_distance, rear_load, side_load, worst, bad,
    )  # fmt: skip


@kernel
def judge_track(
    track: Track, body: Body, n: PlanningLimits, motion: MotionTerms, in_time: bool,
    speed_sq: Floats, clear_distance: float, distance_offset: float, between: int, h: float,
    all_loads: bool,
    survey: Survey, stop_distance: Floats, rear_load: Floats, side_load: Floats, worst: Floats,
    bad: Bools,
) -> None:  # fmt: skip
    stations = speed_sq.shape[0]
    station = track.station
    limit = max(clear_distance, station[0]) + 5.0
    at_risk = _loads_at_risk(track, survey, n.min_load, np.sqrt(speed_sq.max()))
    onset_in, end_in = 0, 0
    target = clear_distance - distance_offset
    last = segment(station, target, stations - 2)
    intercept_work = work_up_to(track, survey, target, last, 0.0)
    speed_work = work_up_to(track, survey, target, last, 1.0) - intercept_work
    quick = not (in_time or at_risk)
    for k in range(stations):
        i = min(k, stations - 2)
        stop_distance[k] = 0.0
        rear_load[k] = survey.rear[k]
        side_load[k] = min(survey.left[k], survey.right[k])
        points = between + 1 if k + 1 < stations else 1
        for point in range(points):
            u = float(k - i) if point == 0 else point / points
            energy = at(speed_sq, i, u)
            if energy <= 0.0:
                continue
            v, s = np.sqrt(energy), at(station, i, u)
            dead, slowest, top = track.dead_time[k], track.slowest[k], track.speed_limit[k]
            if point > 0:
                # A surface that begins in a segment counts at both of its ends.
                dead = min(dead, track.dead_time[k + 1])
                top = max(top, track.speed_limit[k + 1])
            rear, side, end = np.inf, np.inf, s
            well = False
            if quick and (point > 0 or not all_loads):
                well, onset_in = ends_before(
                    track, survey, s, v, dead, slowest, onset_in, target, speed_work, intercept_work
                )
            if well:
                end = min(s, target)
            elif in_time:
                end, rear, side = stop_in_time(
                    track, body, motion, s, v, dead, slowest, i, limit, h
                )
            else:
                end, onset, needed, onset_in, end_in = stop_by_energy(
                    track, survey, s, v, dead, slowest, onset_in, end_in
                )
                if at_risk or (all_loads and point == 0):
                    rear, side = loads_by_energy(
                        track, survey, s, v, slowest, i, end, onset, needed, onset_in, end_in
                    )
            if point == 0:
                stop_distance[k] = end - s + distance_offset
                rear_load[k], side_load[k] = rear, side
            rim = v * _rim_ratio(at(track.curvature, i, u), body.slip_track)
            lateral = energy * abs(at(survey.lean, i, u))
            bad[i] |= _breaks(worst, _OVERRUN, end + distance_offset - clear_distance)
            bad[i] |= _breaks(worst, _AXLE, n.min_load - rear)
            bad[i] |= _breaks(worst, _SIDE, n.min_load - side)
            bad[i] |= _breaks(worst, _SPEED, v - min(n.speed, top))
            bad[i] |= _breaks(worst, _LATERAL, lateral - n.lateral_accel)
            bad[i] |= _breaks(worst, _WHEEL, rim - n.max_wheel_speed)
        if k + 1 < stations and (speed_sq[k] > 0.0 or speed_sq[k + 1] > 0.0):
            bad[k] |= _judge_segment(k, track, survey, n, motion, speed_sq, worst)


@inlined
def _loads_at_risk(track: Track, survey: Survey, min_load: float, fastest: float) -> bool:
    """Could any stop from up to this speed unload the rear or a side too much, anywhere?"""
    least = np.inf
    for k in range(track.station.shape[0]):
        slow = track.slowest[k]
        part = max(slow * track.upper_slope[k], max(fastest, slow) * track.upper_slope[k])
        decel = GRAVITY * max(part + track.upper_intercept[k] + survey.sine[k], 0.0)
        rolling = survey.per_lateral * fastest * fastest * abs(survey.lean[k])
        side = min(survey.left[k], survey.right[k]) - rolling
        least = min(least, min(survey.rear[k] - survey.per_decel * decel, side))
    return not (least >= min_load)


@inlined
def _judge_segment(
    k: int, track: Track, survey: Survey, n: PlanningLimits, motion: MotionTerms, speed_sq: Floats,
    worst: Floats,
) -> bool:  # fmt: skip
    """Does the change of speed from station k on exceed what either of its ends allows?"""
    bad = False
    first, second = np.sqrt(speed_sq[k]), np.sqrt(speed_sq[k + 1])
    slow, fast = min(first, second), max(first, second)
    accel = 0.5 * (speed_sq[k + 1] - speed_sq[k]) / (track.station[k + 1] - track.station[k])
    for m in range(k, k + 2):
        sine = survey.sine[m]
        part = track.lower_slope[m]
        weak = min(max(slow, track.slowest[m]) * part, max(fast, track.slowest[m]) * part)
        # Drag and turning help to slow down, which is not counted on; wind may push.
        pushed = min(
            motion_deceleration(slow, track.curvature[m], track.yaw[m], motion),
            motion_deceleration(fast, track.curvature[m], track.yaw[m], motion),
        )
        braking = GRAVITY * (weak + track.lower_intercept[m] + sine) + min(pushed, 0.0)
        resistance = n.resistance + n.turning_drag * abs(track.curvature[m])
        holding = sine + np.sqrt(1.0 - sine * sine) * resistance
        thrust = GRAVITY * (min(n.specific_force, n.specific_power / max(fast, 1e-9)) - holding)
        front = survey.front[m] - survey.per_accel * max(accel, 0.0)
        bad |= _breaks(worst, _AXLE, n.min_load - front)
        bad |= _breaks(worst, _DECEL, -accel - min(n.decel, braking))
        if not (accel <= 0.0) or thrust < 0.0:
            bad |= _breaks(worst, _ACCEL, accel - min(n.accel, thrust))
    return bad


VIOLATION_LIMITING: dict[str, Limiting] = {
    "overrun": Limiting.STOPPING_PATH,
    "axle_load": Limiting.TIP_OVER,
    "side_load": Limiting.ROLLOVER,
    "speed": Limiting.SPEED_LIMIT,
    "lateral": Limiting.LATERAL,
    "wheel_speed": Limiting.WHEEL_SPEED,
    "accel": Limiting.ACCEL,
    "decel": Limiting.DECEL,
}
"""Which bound a breach belongs to."""
