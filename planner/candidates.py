"""From candidate paths to ranked, verified plans.

Candidates travel as one batch through terrain, bounds and the time-optimal profile; what is emitted
is smoothed and judged one by one. Nothing leaves without the judge's word: a plan that fails is
repaired, then slowed, then replaced by the emergency stop, and says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.errors import ParameterError
from models.parameters import Model
from models.quantity import GRAVITY
from planner.bounds import Numbers, SpeedBounds, numbers, speed_bounds
from planner.check import Verdict, check
from planner.compiled import Floats, Ints
from planner.elevation_map import ElevationMap
from planner.ground import Conditions, Ground, ground_along
from planner.limiting import Limiting
from planner.path import CandidatePath, PathBatch, batch
from planner.plan import SpeedPlan, Status, motion_of, resting_at
from planner.profile import time_optimal_profile
from planner.settings import PlannerSettings
from planner.smoothing import Smoother, SmoothingProblem
from planner.terrain_profile import TerrainProfile, terrain_profile
from planner.track import Track, track_of
from planner.uncertainty import Uncertainty

_BATCH = 256
_REPAIRS = 12
_REPAIR_SHARE = 0.96
_STATION_STEP = 50
_HARDLY = 0.01
"""Accelerations closer than this are one to a reader [m/s²]."""


@dataclass(frozen=True, slots=True)
class TimeOptimalBatch:
    """Time-optimal profiles of M candidates, not judged yet; arrays are (N, M).

    Attributes:
        profile, ground, bounds: what they were made from.
        speed_sq: v² [m²/s²].
        reachable_start_sq: (M,) highest v² at the start that service braking can bring down.
        cost: (M,) travel time plus the charge for what is not reached [s].
    """

    profile: TerrainProfile
    ground: Ground
    bounds: SpeedBounds
    speed_sq: Floats
    reachable_start_sq: Floats
    cost: Floats


def time_optimal_batch(
    elevation_map: ElevationMap,
    x: Floats,
    y: Floats,
    count: Ints,
    model: Model,
    *,
    start_speed: float = 0.0,
    clear: float = np.inf,
    speed_limit: Floats | None = None,
    settings: PlannerSettings | None = None,
    conditions: Conditions | None = None,
    uncertainty: Uncertainty | None = None,
) -> TimeOptimalBatch:
    """Time-optimal profiles along candidates that are on even stations already.

    Args:
        elevation_map: ground.
        x, y: (N, M) positions [m], C-contiguous; count: (M,) stations of each candidate.
        model: vehicle, braking, limits.
        start_speed: speed at the first station [m/s].
        clear: station up to which the way is known free [m].
        speed_limit: (N, M) limits of the path itself [m/s].
        settings: weights of the ranking.
        conditions: of the moment.
        uncertainty: what the plans are to survive; then ``model`` is its cautious one already.
    """
    vehicle = model.vehicle
    profile = terrain_profile(elevation_map, x, y, count, vehicle.wheelbase, vehicle.track_width)
    ground = ground_along(profile, model, elevation_map.class_names, conditions, uncertainty)
    candidates = x.shape[1]
    bounds = speed_bounds(profile, ground, model, np.full(candidates, clear), speed_limit)
    speed_sq, reachable = time_optimal_profile(
        profile.station, bounds.speed_sq_max, profile.sin_grade, ground.weak_speed,
        ground.braking_rest, ground.slowest, bounds.accel_max, bounds.demand,
        np.full(candidates, start_speed**2), numbers(model),
    )  # fmt: skip
    cost = ranking_cost(profile.station, speed_sq, settings or PlannerSettings())
    return TimeOptimalBatch(profile, ground, bounds, speed_sq, reachable, cost)


def ranking_cost(station: Floats, speed_sq: Floats, settings: PlannerSettings) -> Floats:
    """Travel time plus a charge for each metre not reached, (M,) [s]."""
    speed = np.sqrt(speed_sq)
    both = speed[1:] + speed[:-1]
    ds = np.diff(station, axis=0)
    moving = both > 0.0
    time = np.divide(2.0 * ds, both, out=np.zeros_like(ds), where=moving).sum(axis=0)
    missed = np.where(moving, 0.0, ds).sum(axis=0)
    total: Floats = time + settings.horizon_penalty * missed
    return total


def rank(plans: Sequence[SpeedPlan], settings: PlannerSettings) -> list[SpeedPlan]:
    """Plans best first: what may be driven, then the cheapest, then the wider margin."""

    def key(plan: SpeedPlan) -> tuple[bool, bool, float, float]:
        missed = float(plan.station[-1]) - plan.progress
        cost = plan.travel_time + settings.horizon_penalty * missed
        fallback = plan.status is Status.DEGRADED
        return not plan.admissible, fallback, cost, -plan.least_margin

    return sorted(plans, key=key)


class CandidatePlanner:
    """Plans candidates with one model; keeps its solvers from call to call."""

    def __init__(
        self,
        model: Model,
        settings: PlannerSettings | None = None,
        uncertainty: Uncertainty | None = None,
    ) -> None:
        """Plan with the model's mean, or with what remains of it under uncertainty."""
        self.model = model if uncertainty is None else uncertainty.cautious(model)
        self.uncertainty = uncertainty
        self.settings = settings or PlannerSettings()
        self._scalars: Numbers = numbers(model)
        self._smoothers: dict[int, Smoother] = {}

    def plan(
        self,
        elevation_map: ElevationMap,
        paths: Sequence[CandidatePath],
        *,
        start_speed: float = 0.0,
        clear: float = np.inf,
        conditions: Conditions | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> list[SpeedPlan]:
        """A verified plan for every path, in the order given.

        Args:
            elevation_map: ground.
            paths: candidates; a malformed one raises, an undrivable one gets a status.
            start_speed: speed at the first station [m/s].
            clear: station up to which the way is known free [m].
            conditions: of the moment.
            progress: called with the number of candidates done since the last call.

        Raises:
            ParameterError: names the candidate and what is wrong with its path.
        """
        if not (np.isfinite(start_speed) and start_speed >= 0.0):
            raise ParameterError("speed", f"a finite start speed >= 0 [m/s], got {start_speed}")
        if np.isnan(clear) or clear < 0.0:
            raise ParameterError("clear", f"a distance >= 0 [m], got {clear}")
        spacing = self.settings.spacing_on(elevation_map.resolution)
        plans: list[SpeedPlan] = []
        for first in range(0, len(paths), _BATCH):
            part = self._resample(paths[first : first + _BATCH], spacing)
            solved = time_optimal_batch(
                elevation_map, part.x, part.y, part.count, self.model,
                start_speed=start_speed, clear=clear, speed_limit=part.speed_limit,
                settings=self.settings, conditions=conditions, uncertainty=self.uncertainty,
            )  # fmt: skip
            for j, name in enumerate(part.names):
                plans.append(self.finish(solved, j, name, start_speed, part.speed_limit))
                if progress is not None:
                    progress(1)
        return plans

    def _resample(self, paths: Sequence[CandidatePath], spacing: float) -> PathBatch:
        for path in paths:
            try:
                batch([path], spacing)
            except ParameterError as error:
                raise ParameterError(f"{path.name}.{error.field}", error.expected) from None
        return batch(list(paths), spacing)

    def finish(
        self,
        solved: TimeOptimalBatch,
        j: int,
        name: str,
        start_speed: float,
        speed_limit: Floats | None = None,
    ) -> SpeedPlan:
        """Smooth, judge and explain candidate j of a batch."""
        profile, ground, bounds = solved.profile, solved.ground, solved.bounds
        n = int(profile.count[j])
        track = track_of(profile, ground, j, speed_limit)
        work = _Candidate(self.model, self._scalars, track, ground, bounds, j)
        start_sq = start_speed**2
        status, reason = work.standing()
        speed_sq = np.ascontiguousarray(solved.speed_sq[:n, j])
        smoothed = False
        if solved.reachable_start_sq[j] < start_sq - 1e-9:
            speed_sq, verdict, status, reason = work.brake_hard(start_sq, status, reason)
        else:
            speed_sq, verdict, repaired = work.repair(speed_sq, start_sq)
            if repaired:
                status, reason = Status.DEGRADED, repaired
            if self.settings.smooth and speed_sq.any() and verdict.valid:
                answer, why = self._smooth(work, speed_sq)
                judged = work.judge(answer) if answer is not None else verdict
                if answer is not None and judged.valid:
                    speed_sq, verdict, smoothed = answer, judged, True
                else:
                    status = Status.DEGRADED
                    reason = f"not smoothed, so faster changes of acceleration than wanted: {why}"
        status, reason = work.stands_early(speed_sq, status, reason)
        accel, time = motion_of(track.station, speed_sq)
        bound = np.sqrt(np.maximum(bounds.speed_sq_max[:n, j], speed_sq))
        plan = SpeedPlan(
            candidate=name, status=status, reason=reason,
            station=track.station, x=profile.x[:n, j], y=profile.y[:n, j], z=profile.z[:n, j],
            grade=track.grade, roll=track.roll, curvature=track.curvature,
            speed=np.sqrt(speed_sq), accel=accel, time=time, speed_bound=bound,
            limiting=work.limiting(speed_sq, accel, smoothed),
            stop_distance=verdict.stop_distance, clear_distance=float(bounds.clear_distance[j]),
            rear_load=verdict.rear_load, side_load=verdict.side_load,
        )  # fmt: skip
        return plan if work.stops_at is None else resting_at(plan, work.stops_at)

    def _smooth(self, work: _Candidate, speed_sq: Floats) -> tuple[Floats | None, str]:
        n = len(speed_sq)
        # One solver serves all candidates of about the same length.
        size = -(-max(n, _STATION_STEP) // _STATION_STEP) * _STATION_STEP
        if size not in self._smoothers:
            self._smoothers[size] = Smoother(size)
        accel_max, decel_max = work.segment_limits(speed_sq)
        pad = size - n
        problem = SmoothingProblem(
            np.pad(np.diff(work.track.station), (0, pad), constant_values=1.0),
            np.pad(speed_sq, (0, pad)),
            np.pad(accel_max, (0, pad)),
            np.pad(decel_max, (0, pad)),
            self.model.limits.jerk,
        )
        if pad and speed_sq[-1] > 0.0:
            raise AssertionError("a plan must rest at the end of its path")
        result = self._smoothers[size].smooth(problem)
        if result.speed_sq is None:
            return None, result.reason
        return result.speed_sq[:n], "the judge found a breach"


class _Candidate:
    """One candidate on its way through judge, repair and labels."""

    def __init__(
        self,
        model: Model,
        scalars: Numbers,
        track: Track,
        ground: Ground,
        bounds: SpeedBounds,
        j: int,
    ) -> None:
        n = len(track.station)
        self.track = track
        self._model = model
        self._scalars = scalars
        self._motion = ground.motion
        self._offset = float(ground.distance_offset[j])
        self._clear = float(bounds.clear_distance[j])
        self._barrier = Limiting(int(bounds.barrier[j]))
        self._barrier_station = int(bounds.barrier_station[j])
        self._bound = bounds.speed_sq_max[:n, j].copy()
        self._label = bounds.limiting[:n, j]
        self._accel_max = bounds.accel_max[:n, j]
        self._demand = bounds.demand[:n, j]
        self._sine = np.sin(track.grade)
        self.stops_at: float | None = None
        """Where an emergency stop ends, if the plan is one [m]."""
        self._braking_rest = ground.braking_rest[:n, j]

    def judge(self, speed_sq: Floats, *, decel: float | None = None) -> Verdict:
        """Exact constraints of the plan."""
        return check(
            self.track, speed_sq, self._clear, self._offset, self._motion, self._model, decel=decel
        )

    def standing(self) -> tuple[Status, str]:
        """Status by what ends the clear distance, if nothing goes wrong."""
        station = self.track.station
        length = float(station[-1])
        k = self._barrier_station
        if k >= len(station) and self._clear >= length:
            return Status.OK, ""
        where = f"stops before {self._clear:.2f} m of {length:.2f} m"
        if k >= len(station) or (k > 0 and self._clear < station[k - 1]):
            return Status.BLOCKED, f"{where}: the way is known free up to there"
        return Status.BLOCKED, f"{where}: {self._why_barred(k)}"

    def stands_early(self, speed_sq: Floats, status: Status, reason: str) -> tuple[Status, str]:
        """A plan that rests well before the end of its path is not ok, whatever the cause."""
        station = self.track.station
        moving = np.flatnonzero(speed_sq > 0.0)
        k = min(int(moving[-1]) + 1, len(station) - 1) if len(moving) else 0
        short = float(station[-1] - station[k])
        if status is not Status.OK or short <= self._offset + 1.0:
            return status, reason
        label = Limiting(int(self._label[k])).label
        return Status.BLOCKED, f"stops at {station[k]:.2f} m of {station[-1]:.2f} m: {label}"

    def _why_barred(self, k: int) -> str:
        station = self.track.station[k]
        grade, roll = np.rad2deg(self.track.grade[k]), np.rad2deg(self.track.roll[k])
        vehicle = self._model.vehicle
        match self._barrier:
            case Limiting.UNKNOWN_TERRAIN:
                return f"unknown ground under the wheels at {station:.2f} m"
            case Limiting.MODEL_VALIDITY:
                low, high = np.rad2deg(self._model.braking.grade_range)
                return (
                    f"grade {grade:.1f}° at {station:.2f} m is outside the trained "
                    f"{low:.1f}° … {high:.1f}°"
                )
            case Limiting.TIP_OVER:
                return f"an axle keeps too little load on grade {grade:.1f}° at {station:.2f} m"
            case Limiting.ROLLOVER:
                return f"a side keeps too little load on roll {roll:.1f}° at {station:.2f} m"
            case Limiting.SPEED_LIMIT:
                return f"the speed limit of the path is 0 at {station:.2f} m"
            case Limiting.TRACTION:
                needed = self._demand[k] * vehicle.mass * GRAVITY
                return (
                    f"grade {grade:.1f}° at {station:.2f} m needs {needed:.0f} N of thrust, "
                    f"the drive has {vehicle.max_drive_force:.0f} N"
                )
            case _:
                return f"the brakes do not hold on grade {grade:.1f}° at {station:.2f} m"

    def repair(self, speed_sq: Floats, start_sq: float) -> tuple[Floats, Verdict, str]:
        """Lower the bound where the judge objects; at last slow the whole plan down."""
        verdict = self.judge(speed_sq)
        for _ in range(_REPAIRS):
            if verdict.valid:
                return speed_sq, verdict, ""
            for k in (verdict.where, np.minimum(verdict.where + 1, len(speed_sq) - 1)):
                self._bound[k] = np.minimum(self._bound[k], speed_sq[k]) * _REPAIR_SHARE
            answer, reachable = self._profile(start_sq)
            if reachable < start_sq - 1e-9:
                break
            speed_sq, verdict = answer, self.judge(answer)
        if verdict.valid:
            return speed_sq, verdict, ""
        worst = max(verdict.offence)
        name = verdict.offence._fields[int(np.argmax(verdict.offence))]
        share = 1.0
        for _ in range(40):
            share *= 0.9
            slower = speed_sq * share
            slower[0] = min(start_sq, speed_sq[0])
            verdict = self.judge(slower)
            if verdict.valid:
                return slower, verdict, f"slowed to {share:.0%} of v²: {name} by {worst:.3g}"
        still = np.zeros_like(speed_sq)
        return still, self.judge(still), f"not driven: {name} by {worst:.3g} at any speed"

    def brake_hard(
        self, start_sq: float, status: Status, reason: str
    ) -> tuple[Floats, Verdict, Status, str]:
        """The start is faster than service braking can bring down: brake fully until it can."""
        station, track = self.track.station, self.track
        speed = np.sqrt(start_sq)
        answer, _ = self._profile(start_sq)
        reachable = answer[0]
        answer[0] = start_sq
        for k in range(len(station) - 1):
            ds = station[k + 1] - station[k]
            braking = min(self._braking(k, answer[k]), self._braking(k + 1, answer[k]))
            after = max(answer[k] - 2.0 * ds * max(braking, 0.0), 0.0)
            if after <= answer[k + 1]:
                break
            answer[k + 1] = after
        verdict = self.judge(answer, decel=np.inf)
        breach = verdict.offence
        if max(breach.overrun, breach.axle_load, breach.side_load, breach.decel) > 0.0:
            return self._emergency(start_sq)
        if self._bound[0] < start_sq:
            label = Limiting(int(self._label[0])).label
            allowed = f"{np.sqrt(self._bound[0]):.2f} m/s ({label})"
        else:
            allowed = f"{np.sqrt(reachable):.2f} m/s, what service braking can bring down"
        hardest = -motion_of(track.station, answer)[0].min()
        text = f"starts at {speed:.2f} m/s, above {allowed}: brakes at {hardest:.2f} m/s²"
        text += f"; {reason}" if status is Status.BLOCKED else ""
        return answer, verdict, Status.DEGRADED, text

    def _braking(self, k: int, speed_sq: float) -> float:
        """Least deceleration of full braking at station k from this v² down [m/s²]."""
        track = self.track
        slow = float(track.slowest[k])
        fast = max(float(np.sqrt(speed_sq)), slow)
        force = min(slow * track.weak_speed[k], fast * track.weak_speed[k])
        force += self._braking_rest[k]
        return float(GRAVITY * (force + self._sine[k]))

    def _emergency(self, start_sq: float) -> tuple[Floats, Verdict, Status, str]:
        """Full braking from the start, and why even that is not enough, if it is not."""
        station, n = self.track.station, self._scalars
        speed = np.sqrt(start_sq)
        only_start = np.zeros_like(station)
        only_start[0] = start_sq
        verdict = self.judge(only_start, decel=np.inf)
        stop = float(verdict.stop_distance[0])
        onset = speed * self.track.dead_time[0]
        braking = max(stop - self._offset - onset, 1e-6)
        self.stops_at = float(onset + braking)
        speed_sq = start_sq * np.clip(1.0 - (station - onset) / braking, 0.0, 1.0)
        moving = speed_sq > 0.0
        # It brakes already: what is left of this one stop, and its least loads.
        verdict = Verdict(
            np.where(moving, np.maximum(stop - station, 0.0), 0.0),
            np.where(moving, verdict.rear_load[0], verdict.rear_load),
            np.where(moving, verdict.side_load[0], verdict.side_load),
            verdict.offence,
            verdict.where,
        )
        over = stop - self._clear
        if over > 0.0:
            text = (
                f"even full braking from {speed:.2f} m/s takes {stop:.2f} m, "
                f"{over:.2f} m beyond the clear distance of {self._clear:.2f} m"
            )
        elif (lightest := min(verdict.rear_load[0], verdict.side_load[0])) < n.min_load:
            text = (
                f"braking from {speed:.2f} m/s leaves an axle or side {lightest:.1%} of its load, "
                f"{n.min_load:.0%} is wanted"
            )
        else:
            text = f"starts at {speed:.2f} m/s: nothing but full braking to a stop is safe"
            return speed_sq, verdict, Status.DEGRADED, text
        return speed_sq, verdict, Status.INFEASIBLE, text

    def _profile(self, start_sq: float, decel: float | None = None) -> tuple[Floats, float]:
        def column(array: Floats) -> Floats:
            return np.ascontiguousarray(array[:, None])

        track = self.track
        answer, reachable = time_optimal_profile(
            column(track.station), column(self._bound), column(self._sine),
            column(track.weak_speed), column(self._braking_rest), column(track.slowest),
            column(self._accel_max), column(self._demand), np.array([start_sq]),
            self._scalars, decel=decel,
        )  # fmt: skip
        return answer[:, 0], float(reachable[0])

    def segment_limits(self, speed_sq: Floats) -> tuple[Floats, Floats]:
        """Accelerations allowed on each segment at any speed up to this profile, (N − 1,)."""
        track, n = self.track, self._scalars
        fast = np.sqrt(np.maximum(speed_sq, 1e-6))
        accel = np.minimum(self._accel_max[:-1], self._accel_max[1:])
        hold = GRAVITY * np.maximum(self._demand[:-1], self._demand[1:])
        powered = GRAVITY * n.specific_power / np.maximum(fast[:-1], fast[1:]) - hold
        slow_force = track.slowest * track.weak_speed
        fast_force = np.maximum(fast, track.slowest) * track.weak_speed
        braking = np.minimum(slow_force, fast_force) + self._braking_rest + self._sine
        decel = GRAVITY * np.minimum(braking[:-1], braking[1:])
        return (
            np.clip(np.minimum(accel, powered), 0.0, None),
            np.clip(decel, 0.0, n.decel),
        )

    def limiting(self, speed_sq: Floats, accel: Floats, smoothed: bool) -> Ints:
        """What holds at each station, (N,)."""
        bound = self._bound
        at_bound = speed_sq >= bound - 1e-3 * np.maximum(bound, 0.05)
        accel_max, decel_max = self.segment_limits(speed_sq)
        accel_max = np.append(accel_max, accel_max[-1])
        decel_max = np.append(decel_max, decel_max[-1])
        before = np.concatenate((accel[:1], accel[:-1]))
        lowest, highest = np.minimum(accel, before), np.maximum(accel, before)
        slowing = lowest < -_HARDLY
        full = np.where(
            slowing,
            lowest <= -decel_max * 0.99,
            highest >= accel_max * 0.99 - _HARDLY,
        )
        weak_drive = accel_max < 0.99 * self._scalars.accel
        label = np.where(
            slowing, Limiting.DECEL, np.where(weak_drive, Limiting.TRACTION, Limiting.ACCEL)
        )
        if smoothed:
            label = np.where(full, label, Limiting.JERK)
        result: Ints = np.where(at_bound, self._label, label).astype(np.int64)
        return result
