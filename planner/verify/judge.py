"""The judge of a finished plan: is every constraint kept, at the stations and between them?

It shares no approximation with what made the plan: bounds work with tangents and chords of v² and
with sums of sines, the judge follows every emergency stop to its end, on the laws of `models`. The
third writing of a stop, :mod:`slopewise.models.stops.simulation`, is what tests hold both against.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.effects import registry
from slopewise.models.effects.registry import MotionTerms
from slopewise.models.laws import slip_track
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.planner.ground.braking_ground import StopErrors
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.kernels.limits import planning_limits
from slopewise.planner.kernels.motion_laws import motion_deceleration
from slopewise.planner.limiting import Limiting
from slopewise.planner.verify.steering import Steered, follow_steering, steering_terms
from slopewise.planner.verify.stop_by_energy import (
    Shares,
    Target,
    ends_before,
    loads_by_energy,
    stop_by_energy,
    target_at,
)
from slopewise.planner.verify.stop_in_time import may_slide, stop_in_time
from slopewise.planner.verify.track import StopCommand, Survey, Terms, Track, at, body_of, survey_of

TIME_STEP = 0.02
"""Step of the integrator in time [s]; halving it moves a stop by less than 10 µm."""

BETWEEN = 3
"""Points inside each segment from which a stop is tried as well."""

_TOLERANCE = 1e-6
"""Smallest violation [SI unit of the limit]: rounding of sums along a path."""
(
    _OVERRUN,
    _AXLE,
    _SIDE,
    _SPEED,
    _LATERAL,
    _WHEEL,
    _ACCEL,
    _DECEL,
    _VERTICAL,
    _FRICTION,
    _WHEEL_LOAD,
    _TURNING,
    _STEERING_RATE,
) = range(13)
_LEAST_TURN = 0.1
"""Share of the lateral acceleration that any bank leaves to a turn."""

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
    vertical: float
    friction: float
    wheel_load: float
    turning: float
    steering_rate: float


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
    even: Track | None = None,
    errors: StopErrors | None = None,
    decel: float | None = None,
    between: int = BETWEEN,
    time_step: float = TIME_STEP,
) -> Judgement:
    """Judge one plan.

    Args:
        track: the candidate, with what crests and friction leave of the braking force.
        speed_sq: (N,) v², linear between stations [m²/s²].
        clear_distance: station before which every stop must end [m].
        distance_offset: safety offset of the model [m].
        motion: effects on the motion.
        model: vehicle and limits.
        even: the candidate with the whole of the force, for the stops that are told; the same if
            left out.
        errors: of speed and map that every stop has to survive; none if left out.
        decel: planned deceleration allowed, inf for an emergency; that of the model if left out.
        between: points inside each segment to try as well.
        time_step: of the integrator [s].

    Nothing raises: what is not a number, or does not stop, is a breach by infinity.
    """
    n = len(speed_sq)
    stop_distance, rear_load, side_load = np.empty((3, n))
    worst = np.zeros(len(Violations._fields))
    bad = np.zeros(max(n - 1, 1), np.bool_)
    terms = terms_of(model, motion, errors or StopErrors(), all_loads=True)
    terms = terms._replace(between=between, time_step=time_step)
    if decel is not None:
        terms = terms._replace(limits=terms.limits._replace(decel=decel))
    notes = JudgeNotes(stop_distance, rear_load, side_load, worst, bad)
    _check((track, even or track), speed_sq, clear_distance, distance_offset, terms, notes)
    violation = Violations(*(float(w) for w in worst))
    return Judgement(stop_distance, rear_load, side_load, violation, np.flatnonzero(bad))


def terms_of(model: Model, motion: MotionTerms, errors: StopErrors, *, all_loads: bool) -> Terms:
    """What plans of a model are judged by, with these effects on the motion and these errors."""
    in_time = motion != registry.NO_MOTION._replace(heat=motion.heat)
    limits = planning_limits(model)
    return Terms(
        body_of(model),
        limits,
        motion,
        errors,
        steering_terms(model),
        in_time,
        BETWEEN,
        TIME_STEP,
        all_loads,
    )


class JudgedPlan(NamedTuple):
    """One plan as it is judged.

    Attributes:
        track, survey: the candidate, (N,) each.
        even, even_survey: the same with the braking force as it is learned, on even ground: the
            stops that a plan reports are of these, those that it survives of the others.
        speed_sq: (N,) v², linear between stations [m²/s²].
        clear_distance: station before which every stop must end [m].
        distance_offset: safety offset of the model, added to every stop [m].
    """

    track: Track
    survey: Survey
    even: Track
    even_survey: Survey
    speed_sq: Floats
    clear_distance: float
    distance_offset: float


class JudgeNotes(NamedTuple):
    """What :func:`judge_track` fills in.

    Attributes:
        stop_distance, rear_load, side_load: (N,) as of :class:`Judgement`.
        worst: (13,) worst breach of each kind, in the order of :class:`Violations`; only raised.
        bad: (N − 1,) segments in or at the start of which something is breached; only set.
    """

    stop_distance: Floats
    rear_load: Floats
    side_load: Floats
    worst: Floats
    bad: Bools


class _Watch(NamedTuple):
    """How closely the stops of a plan have to be followed.

    Attributes:
        target: where they have to end.
        limit: those that get here are not followed further [m].
        at_risk: loads may run short. quick: the target alone decides.
        sticks: (N,) station up to which no stop from a segment slides [m].
    """

    target: Target
    limit: float
    at_risk: bool
    quick: bool
    sticks: Floats


@inlined
def _breaks(worst: Floats, kind: int, breach: float) -> bool:
    """Note a breach; what is not a number is one as well."""
    if breach <= _TOLERANCE:
        return False
    worst[kind] = max(worst[kind], breach if np.isfinite(breach) else np.inf)
    return True


@kernel
def _check(
    tracks: tuple[Track, Track],
    speed_sq: Floats,
    clear_distance: float,
    distance_offset: float,
    terms: Terms,
    notes: JudgeNotes,
) -> None:
    track, even = tracks
    survey = survey_of(track, terms.body, np.empty((8, speed_sq.shape[0])))
    even_survey = survey_of(even, terms.body, np.empty((8, speed_sq.shape[0])))
    plan = JudgedPlan(track, survey, even, even_survey, speed_sq, clear_distance, distance_offset)
    judge_track(plan, terms, notes)


@kernel
def judge_track(plan: JudgedPlan, terms: Terms, notes: JudgeNotes) -> None:
    """Follow the stops from every station and from points between; note every breach.

    Args:
        plan: track, survey and v², all of N >= 2 stations, SI.
        terms: what it is judged by, SI.
        notes: filled in; ``worst`` and ``bad`` keep what they hold already.

    A v² that is not a number, or a stop that does not end, is a breach by infinity: nothing raises.
    """
    track, survey, speed_sq = plan.track, plan.survey, plan.speed_sq
    stations = speed_sq.shape[0]
    fastest = _fastest(track, survey, terms, np.sqrt(speed_sq.max()))
    at_risk = _loads_at_risk(track, survey, terms, fastest)
    steered, along_track = follow_steering(track, terms.steering), terms.errors.along_track
    sticks = np.empty(stations)
    _sticks(track, terms, fastest, sticks)
    watch = _Watch(
        target_at(track, survey, plan.clear_distance - plan.distance_offset - along_track),
        max(plan.clear_distance, track.station[0]) + 5.0,
        at_risk,
        not (terms.in_time or at_risk),
        sticks,
    )
    onset_in, end_in = 0, 0
    for k in range(stations):
        i = min(k, stations - 2)
        notes.stop_distance[k] = 0.0
        notes.rear_load[k] = survey.rear[k]
        notes.side_load[k] = min(survey.left[k], survey.right[k])
        points = terms.between + 1 if k + 1 < stations else 1
        for point in range(points):
            u = float(k - i) if point == 0 else point / points
            energy = at(speed_sq, i, u)
            if energy <= 0.0:
                continue
            speed, top = np.sqrt(energy), track.speed_limit[k]
            dead = track.dead_time[k]
            if point > 0:
                # A surface that begins in a segment counts at both of its ends.
                dead = min(dead, track.dead_time[k + 1])
                top = max(top, track.speed_limit[k + 1])
            command = StopCommand(at(track.station, i, u), speed, dead, track.slowest[k])
            told = terms.all_loads and point == 0
            real = _as_it_may_be(track, survey, terms, command, i)
            end, shares, onset_in, end_in = _follow(
                (track, survey), terms, watch, real, (i, onset_in, end_in, False)
            )
            if told:
                planned, least, _, _ = _follow(
                    (plan.even, plan.even_survey), terms, watch, command, (i, i, i, True)
                )
                notes.stop_distance[k] = planned - command.station + plan.distance_offset
                notes.rear_load[k], notes.side_load[k] = least[0], least[1]
            over = end + plan.distance_offset + along_track - plan.clear_distance
            bad = _judge_point(plan, terms, (i, u, energy), (over, top), shares, notes.worst)
            notes.bad[i] |= bad
        if k + 1 < stations and (speed_sq[k] > 0.0 or speed_sq[k + 1] > 0.0):
            notes.bad[k] |= _judge_segment(k, plan, terms, notes.worst)
            notes.bad[k] |= _verify_steering(k, speed_sq, steered, notes.worst)


@inlined
def _follow(
    ground: tuple[Track, Survey],
    terms: Terms,
    watch: _Watch,
    command: StopCommand,
    start: tuple[int, int, int, bool],
) -> tuple[float, Shares, int, int]:
    """Where a stop ends, the least loads on it, and the segments of its onset and end.

    Args:
        ground: the track that is braked on.
        start: segments of the command, and of the last stop's onset and end; and whether it is told
            as planned: then a yes or no will not do, and the map counts as exact.
    """
    track, survey = ground
    i, onset_in, end_in, told = start
    height = 0.0 if told else terms.errors.height
    least = (np.inf, np.inf, np.inf)
    sticks = np.inf if told else watch.sticks[i]
    if watch.quick and not told and watch.target.station <= sticks:
        well, onset_in = ends_before(track, survey, command, onset_in, watch.target, height)
        if well:
            return min(command.station, watch.target.station), least, onset_in, end_in
    if not terms.in_time and command.station <= sticks:
        stop = stop_by_energy(track, survey, command, onset_in, end_in, height)
        if stop.station <= sticks:
            if watch.at_risk or told:
                least = loads_by_energy(track, survey, command, i, stop)
            return stop.station, least, stop.onset_in, stop.end_in
    end, least = stop_in_time(track, terms, command, i, (watch.limit, height, not told))
    return end, least, onset_in, end_in


@inlined
def _as_it_may_be(
    track: Track, survey: Survey, terms: Terms, command: StopCommand, i: int
) -> StopCommand:
    """The stop of a vehicle that is faster than planned, late, and rolls on in its dead time."""
    errors, dead = terms.errors, command.dead_time
    speed, gain = command.speed + errors.speed, 0.0
    late = speed * errors.latency
    if errors.drive_cut and dead > 0.0:
        last = track.station.shape[0] - 1
        m = i
        while True:
            gain = max(gain, -GRAVITY * (survey.sine[m] + terms.limits.resistance))
            reached = command.station + late + (speed + 0.5 * gain * dead) * dead
            if m >= last or (m > i and track.station[m] > reached):
                break
            m += 1
    if gain <= 0.0:
        return StopCommand(command.station, speed, dead + errors.latency, command.slowest)
    distance = late + (speed + 0.5 * gain * dead) * dead
    onset = speed + gain * dead
    return StopCommand(command.station, onset, distance / onset, command.slowest)


@inlined
def _judge_point(
    plan: JudgedPlan,
    terms: Terms,
    place: tuple[int, float, float],
    stop: tuple[float, float],
    shares: Shares,
    worst: Floats,
) -> bool:
    """Is anything breached at share u of segment i, at this v²?

    Args:
        place: i, u and v².
        stop: metres beyond the clear distance, and the highest speed there.
        shares: least loads on the stop.
    """
    limits = terms.limits
    i, u, energy = place
    over, top = stop
    speed = np.sqrt(energy)
    rim = speed * _rim_ratio(at(plan.track.curvature, i, u), terms.body.slip_track)
    lean = at(plan.survey.lean, i, u)
    # Half the difference of the sides' shares at rest is the bank, for each lateral g.
    bank = at(plan.survey.right, i, u) - at(plan.survey.left, i, u)
    bank /= 2.0 * plan.survey.per_lateral
    outward = bank if lean > 0.0 else -bank
    allowed = max(limits.lateral_accel - max(outward, 0.0), _LEAST_TURN * limits.lateral_accel)
    vertical = energy * at(plan.track.vertical_curvature, i, u)
    bad = _breaks(worst, _OVERRUN, over)
    bad |= _breaks(worst, _AXLE, limits.min_load - shares[0])
    bad |= _breaks(worst, _SIDE, limits.min_load - shares[1])
    bad |= _breaks(worst, _WHEEL_LOAD, limits.min_load - shares[2])
    bad |= _breaks(worst, _SPEED, speed - min(limits.speed, top))
    bad |= _breaks(worst, _LATERAL, energy * abs(lean) - allowed)
    bad |= _breaks(worst, _VERTICAL, vertical - limits.vertical_accel)
    bad |= _breaks(worst, _WHEEL, rim - limits.max_wheel_speed)
    return bad


@inlined
def _fastest(track: Track, survey: Survey, terms: Terms, fastest: float) -> float:
    """Highest speed of any stop, with its errors, from up to a planned speed [m/s]."""
    errors, resistance = terms.errors, terms.limits.resistance
    rolls_on = -GRAVITY * (survey.sine.min() + resistance) if errors.drive_cut else 0.0
    return float(fastest + errors.speed + max(rolls_on, 0.0) * track.dead_time.max())


@inlined
def _sticks(track: Track, terms: Terms, fastest: float, sticks: Floats) -> None:
    """Station up to which no stop from each segment slides: none that is faster than this."""
    ahead = np.inf
    for k in range(track.station.shape[0] - 1, -1, -1):
        if may_slide(track, terms.limits, k, fastest):
            ahead = track.station[k - 1] if k > 0 else -np.inf
        sticks[k] = ahead


@inlined
def _loads_at_risk(track: Track, survey: Survey, terms: Terms, fastest: float) -> bool:
    """Could any stop from up to this speed unload an axle, side or wheel too much, anywhere?"""
    least = np.inf
    for k in range(track.station.shape[0]):
        slow = track.slowest[k]
        part = max(slow * track.upper_slope[k], max(fastest, slow) * track.upper_slope[k])
        decel = GRAVITY * max(part + track.upper_intercept[k] + survey.sine[k], 0.0)
        lost = max(-track.vertical_curvature[k], 0.0) * fastest * fastest / GRAVITY
        rolling = survey.per_lateral * fastest * fastest * abs(survey.lean[k])
        side = min(survey.left[k], survey.right[k]) - rolling
        axle = min(survey.rear[k] - survey.per_decel * decel, survey.front[k])
        upright = 0.5 * (survey.left[k] + survey.right[k])
        least = min(least, min(min(axle, side), axle + side - upright) - lost)
    return not (least >= terms.limits.min_load)


@inlined
def _judge_segment(k: int, plan: JudgedPlan, terms: Terms, worst: Floats) -> bool:
    """Does the change of speed from station k on exceed what either of its ends allows?"""
    track, survey, speed_sq = plan.track, plan.survey, plan.speed_sq
    limits, motion = terms.limits, terms.motion
    bad = False
    first, second = np.sqrt(speed_sq[k]), np.sqrt(speed_sq[k + 1])
    slow, fast = min(first, second), max(first, second)
    accel = 0.5 * (speed_sq[k + 1] - speed_sq[k]) / (track.station[k + 1] - track.station[k])
    for m in range(k, k + 2):
        sine = survey.sine[m]
        part = track.lower_slope[m]
        lower = min(max(slow, track.slowest[m]) * part, max(fast, track.slowest[m]) * part)
        # Drag and turning help to slow down, which is not counted on; wind may push.
        pushed = min(
            motion_deceleration(slow, track.curvature[m], track.yaw[m], motion),
            motion_deceleration(fast, track.curvature[m], track.yaw[m], motion),
        )
        braking = GRAVITY * (lower + track.lower_intercept[m] + sine) + min(pushed, 0.0)
        resistance = limits.resistance + limits.turning_drag * abs(track.curvature[m])
        holding = sine + np.sqrt(1.0 - sine * sine) * resistance
        thrust = GRAVITY * (
            min(limits.specific_force, limits.specific_power / max(fast, 1e-9)) - holding
        )
        front = survey.front[m] - survey.per_accel * max(accel, 0.0)
        bad |= _breaks(worst, _AXLE, limits.min_load - front)
        bad |= _breaks(worst, _DECEL, -accel - min(limits.decel, braking))
        if not (accel <= 0.0) or thrust < 0.0:
            bad |= _breaks(worst, _ACCEL, accel - min(limits.accel, thrust))
        if track.friction[m] < np.inf:
            driven = max(accel / GRAVITY + holding, -(accel / GRAVITY + sine))
            bad |= _breaks(worst, _FRICTION, _slides_by(m, driven, speed_sq[m], plan))
    return bad


@inlined
def _verify_steering(k: int, speed_sq: Floats, steered: Steered, worst: Floats) -> bool:
    """Return True if the segment from station k on turns too tightly, or too quickly."""
    fast = np.sqrt(max(speed_sq[k], speed_sq[k + 1]))
    bad = _breaks(worst, _TURNING, steered.excess[k + 1])
    bad |= _breaks(worst, _STEERING_RATE, fast - steered.max_speed[k])
    return bad


@inlined
def _slides_by(m: int, along: float, energy: float, plan: JudgedPlan) -> float:
    """By how much the force at station m, a share of the weight, exceeds friction there."""
    track = plan.track
    grade, roll = track.grade[m], track.roll[m]
    normal = np.cos(grade) * np.cos(roll)
    normal += min(track.vertical_curvature[m], 0.0) * energy / GRAVITY
    across = np.sin(roll) * np.cos(grade) + track.curvature[m] * energy / GRAVITY
    return float(np.hypot(along, across) - track.friction[m] * normal)


VIOLATION_LIMITING: dict[str, Limiting] = {
    "overrun": Limiting.STOPPING_PATH,
    "axle_load": Limiting.TIP_OVER,
    "side_load": Limiting.ROLLOVER,
    "speed": Limiting.SPEED_LIMIT,
    "lateral": Limiting.LATERAL,
    "wheel_speed": Limiting.WHEEL_SPEED,
    "accel": Limiting.ACCEL,
    "decel": Limiting.DECEL,
    "vertical": Limiting.CREST,
    "friction": Limiting.FRICTION,
    "wheel_load": Limiting.ROLLOVER,
    "turning": Limiting.STEERING,
    "steering_rate": Limiting.STEERING,
}
"""Which bound a breach belongs to."""
