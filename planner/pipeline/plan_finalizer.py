"""One candidate, from its time-optimal profile to its plan: smoothed, judged, explained.

Nothing leaves without the judge's word: a plan that fails is repaired, then slowed, then replaced
by the emergency stop, and says so.
"""

from __future__ import annotations

import numpy as np

from models.parameters import Model
from models.quantity import GRAVITY
from planner.bounds.speed_bounds import SpeedBounds
from planner.ground.braking_ground import BrakingGround
from planner.ground.terrain_profile import TerrainProfile
from planner.kernels.compiled import Floats, Ints
from planner.kernels.limits import PlanningLimits
from planner.limiting import Limiting
from planner.pipeline import labels
from planner.plan import SpeedPlan, Status, motion_of
from planner.profile.smoothing import SmoothingProblem, smooth
from planner.profile.time_optimal import ProfileProblem, time_optimal_profile
from planner.verify.judge import Judgement, check
from planner.verify.track import track_of

_REPAIRS = 12
_REPAIR_SHARE = 0.96


class PlanFinalizer:
    """One candidate on its way through smoothing, judge, repair and labels.

    Its first stations may be driven already: ``lead`` holds their v², and planning goes on from the
    last of them. Stations before ``first`` only give the next one its heading.
    """

    def __init__(
        self,
        model: Model,
        scalars: PlanningLimits,
        profile: TerrainProfile,
        ground: BrakingGround,
        bounds: SpeedBounds,
        j: int,
        fixed_prefix: Floats,
        *,
        speed_limit: Floats | None = None,
        first: int = 0,
    ) -> None:
        """Take candidate j out of a batch.

        Args:
            model, scalars: vehicle, braking, limits; and its numbers.
            profile, ground, bounds: of the batch.
            j: index of the candidate.
            lead: (h,) v² of its first h >= 1 stations, from ``first`` on [m²/s²].
            speed_limit: (N, M) limits of the paths themselves [m/s].
            first: stations at the beginning that are left out.
        """
        self.track = track_of(profile, ground, j, speed_limit, first)
        n = first + len(self.track.station)
        begin = float(profile.station[first, j])
        self.x, self.y, self.z = (a[first:n, j] for a in (profile.x, profile.y, profile.z))
        self._model, self._scalars = model, scalars
        self._fixed_prefix = fixed_prefix
        self._motion = ground.motion
        self._offset = float(ground.distance_offset[j])
        self.clear = float(bounds.clear_distance[j]) - begin
        self._barrier = Limiting(int(bounds.barrier[j]))
        self._barrier_station = int(bounds.barrier_station[j]) - first
        self._speed_sq_max = bounds.speed_sq_max[first:n, j]
        self._bound = self._speed_sq_max.copy()
        self._label = np.ascontiguousarray(bounds.limiting[first:n, j])
        self._accel_max = np.ascontiguousarray(bounds.accel_max[first:n, j])
        self._demand = np.ascontiguousarray(bounds.demand[first:n, j])
        self._sine = np.sin(self.track.grade)
        self._braking_intercept = np.ascontiguousarray(ground.braking_intercept[first:n, j])

    def finish(
        self,
        name: str,
        speed_sq: Floats,
        *,
        smoothed: bool = True,
        reachable: bool = True,
        innocent: bool = False,
        start_accel: float | None = None,
        unsmoothed: str = "",
    ) -> SpeedPlan:
        """The plan of this candidate.

        Args:
            name: of the candidate.
            speed_sq: (N,) its time-optimal profile, beginning with the lead [m²/s²].
            smoothed: False leaves the profile as it is.
            reachable: service braking can bring down the speed at the start.
            innocent: the judge had no objection to the profile already.
            start_accel: acceleration before the lead's last station [m/s²], None if any will do.
            unsmoothed: why it is not smoothed, if that is less than what was wanted.
        """
        status, reason = self.standing()
        wanted = smoothed and bool(speed_sq.any())
        if wanted and innocent and reachable:
            answer, _ = self._smooth(speed_sq, start_accel)
            verdict = None if answer is None else self.judge(answer)
            if answer is not None and verdict is not None and verdict.valid:
                status, reason = self.stands_early(answer, status, reason)
                return self._plan(name, status, reason, answer, verdict, True)
        is_smooth = False
        if not reachable:
            speed_sq, verdict, status, reason = self.brake_hard(status, reason)
        else:
            speed_sq, verdict, repaired = self.repair(speed_sq)
            if repaired:
                status, reason = Status.DEGRADED, repaired
            if speed_sq[0] < self._fixed_prefix[0]:
                # Not even slower plans pass, and a vehicle that moves cannot just stand.
                speed_sq, verdict, status, reason = self._emergency(float(self._fixed_prefix[0]))
                wanted = False
            if unsmoothed and speed_sq.any():
                status, reason = Status.DEGRADED, unsmoothed
            if wanted and verdict.valid:
                answer, why = self._smooth(speed_sq, start_accel)
                judged = self.judge(answer) if answer is not None else verdict
                if answer is not None and judged.valid:
                    speed_sq, verdict, is_smooth = answer, judged, True
                else:
                    status = Status.DEGRADED
                    reason = f"not smoothed, so faster changes of acceleration than wanted: {why}"
        status, reason = self.stands_early(speed_sq, status, reason)
        return self._plan(name, status, reason, speed_sq, verdict, is_smooth)

    def keep(self, name: str, speed_sq: Floats) -> SpeedPlan | None:
        """The plan that drives a given profile, None if the judge objects to it."""
        verdict = self.judge(speed_sq)
        if not verdict.valid:
            return None
        status, reason = self.stands_early(speed_sq, *self.standing())
        return self._plan(name, status, reason, speed_sq, verdict, True)

    def _plan(
        self, name: str, status: Status, reason: str, speed_sq: Floats, verdict: Judgement,
        smoothed: bool,
    ) -> SpeedPlan:  # fmt: skip
        track = self.track
        accel, time = motion_of(track.station, speed_sq)
        bound = np.sqrt(np.maximum(self._speed_sq_max, speed_sq))
        return SpeedPlan(
            candidate=name, status=status, reason=reason,
            station=track.station, x=self.x, y=self.y, z=self.z,
            grade=track.grade, roll=track.roll, curvature=track.curvature,
            speed=np.sqrt(speed_sq), accel=accel, time=time, speed_bound=bound,
            limiting=self.limiting(speed_sq, accel, smoothed),
            stop_distance=verdict.stop_distance, clear_distance=self.clear,
            rear_load=verdict.rear_load, side_load=verdict.side_load,
        )  # fmt: skip

    def _smooth(self, speed_sq: Floats, start_accel: float | None) -> tuple[Floats | None, str]:
        if speed_sq[-1] > 0.0:
            raise AssertionError("a plan must rest at the end of its path")
        begin = len(self._fixed_prefix) - 1
        accel_max, decel_max = self.segment_limits(speed_sq)
        result = smooth(
            SmoothingProblem(
                np.diff(self.track.station[begin:]), speed_sq[begin:], accel_max[begin:],
                decel_max[begin:], self._model.limits.jerk, start_accel,
            )
        )  # fmt: skip
        if result.speed_sq is None:
            return None, result.reason
        answer = np.concatenate((self._fixed_prefix[:-1], result.speed_sq))
        return answer, "the judge found a breach"

    def judge(self, speed_sq: Floats, *, decel: float | None = None) -> Judgement:
        """Exact constraints of the plan."""
        return check(
            self.track, speed_sq, self.clear, self._offset, self._motion, self._model, decel=decel
        )

    def standing(self) -> tuple[Status, str]:
        """Status by what ends the clear distance, if nothing goes wrong."""
        station = self.track.station
        length = float(station[-1])
        k = self._barrier_station
        if k >= len(station) and self.clear >= length:
            return Status.OK, ""
        where = f"stops before {self.clear:.2f} m of {length:.2f} m"
        if k >= len(station) or (k > 0 and self.clear < station[k - 1]):
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

    def repair(self, speed_sq: Floats) -> tuple[Floats, Judgement, str]:
        """Lower the bound where the judge objects; at last slow the whole plan down."""
        verdict = self.judge(speed_sq)
        for _ in range(_REPAIRS):
            if verdict.valid:
                return speed_sq, verdict, ""
            for k in (verdict.where, np.minimum(verdict.where + 1, len(speed_sq) - 1)):
                self._bound[k] = np.minimum(self._bound[k], speed_sq[k]) * _REPAIR_SHARE
            answer, reachable = self.fastest()
            if not reachable:
                break
            speed_sq, verdict = answer, self.judge(answer)
        if verdict.valid:
            return speed_sq, verdict, ""
        worst = max(verdict.violation)
        name = verdict.violation._fields[int(np.argmax(verdict.violation))]
        share = 1.0
        for _ in range(40):
            share *= 0.9
            slower = speed_sq * share
            slower[: len(self._fixed_prefix)] = speed_sq[: len(self._fixed_prefix)]
            verdict = self.judge(slower)
            if verdict.valid:
                return slower, verdict, f"slowed to {share:.0%} of v²: {name} by {worst:.3g}"
        still = np.zeros_like(speed_sq)
        return still, self.judge(still), f"not driven: {name} by {worst:.3g} at any speed"

    def brake_hard(self, status: Status, reason: str) -> tuple[Floats, Judgement, Status, str]:
        """The start is faster than service braking can bring down: brake fully until it can."""
        station, track = self.track.station, self.track
        start_sq = float(self._fixed_prefix[0])
        speed = np.sqrt(start_sq)
        answer, _ = self._profile(0, start_sq)
        reachable = answer[0]
        answer[0] = start_sq
        for k in range(len(station) - 1):
            ds = station[k + 1] - station[k]
            braking = min(self._braking(k, answer[k]), self._braking(k + 1, answer[k]))
            after = answer[k] - 2.0 * ds * max(braking, 0.0)
            if after <= answer[k + 1]:
                if answer[k + 1] == 0.0:
                    self._rest_at(float(station[k] + 0.5 * answer[k] / braking), k + 1)
                break
            answer[k + 1] = after
        verdict = self.judge(answer, decel=np.inf)
        breach = verdict.violation
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

    def _rest_at(self, rest: float, k: int) -> None:
        """Move station k back to where the vehicle comes to rest before it.

        A hard stop ends where it ends; to move on to the next station would be further. The end of
        the path stays where it is.
        """
        track = self.track
        u = (rest - track.station[k - 1]) / (track.station[k] - track.station[k - 1])
        if u >= 1.0 or k == len(track.station) - 1:
            return
        u = max(u, 1e-6)

        def moved(values: Floats) -> Floats:
            values = values.copy()
            values[k] = values[k - 1] + u * (values[k] - values[k - 1])
            return values

        names = ("station", "grade", "roll", "curvature", "yaw")
        self.track = track._replace(**{name: moved(getattr(track, name)) for name in names})
        self.x, self.y, self.z = moved(self.x), moved(self.y), moved(self.z)
        self._sine = np.sin(self.track.grade)

    def _braking(self, k: int, speed_sq: float) -> float:
        """Least deceleration of full braking at station k from this v² down [m/s²]."""
        track = self.track
        slow = float(track.slowest[k])
        fast = max(float(np.sqrt(speed_sq)), slow)
        force = min(slow * track.lower_slope[k], fast * track.lower_slope[k])
        force += self._braking_intercept[k]
        return float(GRAVITY * (force + self._sine[k]))

    def _emergency(self, start_sq: float) -> tuple[Floats, Judgement, Status, str]:
        """Full braking from the start, and why even that is not enough, if it is not."""
        station, n = self.track.station, self._scalars
        speed = np.sqrt(start_sq)
        only_start = np.zeros_like(station)
        only_start[0] = start_sq
        verdict = self.judge(only_start, decel=np.inf)
        stop = float(verdict.stop_distance[0])
        onset = speed * self.track.dead_time[0]
        braking = max(stop - self._offset - onset, 1e-6)
        speed_sq = start_sq * np.clip(1.0 - (station - onset) / braking, 0.0, 1.0)
        k = int(np.argmin(speed_sq > 0.0))
        if k > 0:
            self._rest_at(float(onset + braking), k)
            station = self.track.station
        moving = speed_sq > 0.0
        # It brakes already: what is left of this one stop, and its least loads.
        verdict = Judgement(
            np.where(moving, np.maximum(stop - station, 0.0), 0.0),
            np.where(moving, verdict.rear_load[0], verdict.rear_load),
            np.where(moving, verdict.side_load[0], verdict.side_load),
            verdict.violation,
            verdict.where,
        )
        over = stop - self.clear
        if over > 0.0:
            text = (
                f"even full braking from {speed:.2f} m/s takes {stop:.2f} m, "
                f"{over:.2f} m beyond the clear distance of {self.clear:.2f} m"
            )
        elif (lightest := min(verdict.rear_load[0], verdict.side_load[0])) < n.min_load:
            text = (
                f"braking from {speed:.2f} m/s leaves an axle or side {lightest:.1%} of its load, "
                f"{n.min_load:.0%} is wanted"
            )
        else:
            text = f"starts at {speed:.2f} m/s: only full braking at once stops in time"
        return speed_sq, verdict, Status.INFEASIBLE, text

    def fastest(self) -> tuple[Floats, bool]:
        """The fastest profile that begins with the lead; and does service braking get it there?"""
        begin = len(self._fixed_prefix) - 1
        answer, reachable = self._profile(begin, float(self._fixed_prefix[-1]))
        fits = bool(reachable >= self._fixed_prefix[-1] - 1e-9)
        return np.concatenate((self._fixed_prefix[:-1], answer)), fits

    def _profile(self, begin: int, start_sq: float) -> tuple[Floats, float]:
        def column(array: Floats) -> Floats:
            return np.ascontiguousarray(array[begin:, None])

        track, limits = self.track, self._scalars
        problem = ProfileProblem(
            column(track.station), column(self._bound), column(self._sine),
            column(track.lower_slope), column(self._braking_intercept), column(track.slowest),
            column(self._accel_max), column(self._demand), np.array([start_sq]),
            limits.decel, limits.specific_power,
        )  # fmt: skip
        answer, reachable = time_optimal_profile(problem)
        return answer[:, 0], float(reachable[0])

    def segment_limits(self, speed_sq: Floats) -> tuple[Floats, Floats]:
        """Accelerations allowed on each segment at any speed up to this profile, (N − 1,)."""
        accel, decel = np.empty((2, len(speed_sq) - 1))
        labels.segment_limits(
            self.track, speed_sq, self._accel_max, self._demand, self._braking_intercept,
            self._scalars, accel, decel,
        )  # fmt: skip
        return accel, decel

    def limiting(self, speed_sq: Floats, accel: Floats, smoothed: bool) -> Ints:
        """What holds at each station, (N,)."""
        accel_max, decel_max = self.segment_limits(speed_sq)
        result = np.empty(len(speed_sq), np.int64)
        labels.labels(
            speed_sq, accel, self._bound, self._label, accel_max, decel_max,
            self._scalars.accel, smoothed, result,
        )  # fmt: skip
        return result
