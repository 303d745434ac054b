"""One candidate of a batch, alone: what bounds its plan, and what its profiles are verified by.

The stopping of a vehicle that starts too fast may move a station, and repair lowers the bound: a
column belongs to one plan.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.quantity import GRAVITY
from slopewise.planner.compiled_core import core
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.band_bounds import SideBounds
from slopewise.planner.pipeline.momentum import momentum_over
from slopewise.planner.pipeline.time_optimal_batch import ROUNDING, TimeOptimalBatch
from slopewise.planner.plan import Momentum, Obstacle
from slopewise.planner.verify.ground import GroundFinding, first_blocked
from slopewise.planner.verify.verifier import Verification, beyond_of, check, track_of

_TRIED = 8
"""Speeds from that of a plan to its bound at which the verifier is asked whether they hold [1]."""


class CandidateColumn:
    """N stations of candidate j, contiguous and without padding; arrays are (N,).

    Attributes:
        model, scalars: vehicle, braking, limits; and its numbers. solver: that smooths first.
        fixed_prefix: (h,) v² of the first h >= 1 stations, which no profile changes [m²/s²].
        track: geometry and braking as the verifier takes them; even: the same with the whole of the
            braking force; x, y, z: positions [m].
        clear: station before which every stop ends [m]; offset: safety offset of a stop [m].
        barrier, barrier_station: what ends the clear distance, and the first station it bars.
        speed_sq_max: highest v² as the bounds have it, and repairs of them [m²/s²].
        bound: the same, lowered by repairs of changes of speed as well [m²/s²].
        label: which bound that is, as :class:`Limiting`.
        problem: task of the fastest profile below the bound.
        errors: of speed and map that every stop survives.
        blocked: ground before the end of the clear distance of the bounds that the verifier alone
            found; the clear distance ends there.
        known: the ground under path and wheels is.
        at_side: ground next to the path, within the band of tracking, holds the bound.
        clear_at_side: station up to which that ground may be driven and rested on [m].
    """

    def __init__(
        self,
        solved: TimeOptimalBatch,
        j: int,
        fixed_prefix: Floats,
        first: int = 0,
        sides: SideBounds | None = None,
    ) -> None:
        """Take candidate j from a batch.

        Args:
            solved: the batch.
            j: index of the candidate.
            fixed_prefix: (h,) v² of its first h >= 1 stations, from ``first`` on [m²/s²].
            first: stations at the beginning that are omitted; they only give the next one its
                heading.
            sides: bounds of all candidates of the batch, if they are known already.
        """
        profile, ground, bounds = solved.profile, solved.ground, solved.bounds
        self.model, self.scalars, self.solver = solved.model, solved.terms.limits, solved.solver
        self.fixed_prefix = fixed_prefix
        self.track = track_of(profile, ground, j, solved.speed_limit, first)
        self.even = track_of(profile, bounds.even_ground, j, solved.speed_limit, first)
        n = first + len(self.track.station)
        self._hazards, self._index = solved.hazards, (j, first)
        if self._hazards.rough_speed is not None:
            rough = self._hazards.rough_speed[first:n, j]
            np.minimum(self.track.speed_limit, rough, out=self.track.speed_limit)
        self.x, self.y, self.z = (a[first:n, j] for a in (profile.x, profile.y, profile.z))
        self.clear = float(bounds.clear_distance[j]) - float(profile.station[first, j])
        self.offset = float(ground.distance_offset[j])
        self.barrier = Limiting(int(bounds.barrier[j]))
        self.barrier_station = int(bounds.barrier_station[j]) - first
        self.known = profile.known[first:n, j]
        self.speed_sq_max = bounds.speed_sq_max[first:n, j]
        self.bound = self.speed_sq_max.copy()
        self.label = np.ascontiguousarray(bounds.limiting[first:n, j])
        self.problem = solved.problem.part(slice(first, n), slice(j, j + 1))._replace(
            station=self.track.station[:, None],
            speed_sq_max=self.bound[:, None],
            sin_grade=np.sin(self.track.grade)[:, None],
        )
        self.errors = ground.errors
        self._terms = solved.terms
        self.blocked: GroundFinding | None = None
        self.at_side, self.clear_at_side = np.zeros(n - first, bool), np.inf
        if (around := solved.around) is None:
            return
        clear, ground = float(bounds.clear_distance[j]), bounds.even_ground
        seen = around.elevation_map, around.errors
        finding = first_blocked(*seen, profile, ground, self.model, j, (first, clear))
        if finding is not None:
            self._stop_before(finding._replace(station=finding.station - profile.station[first, j]))
        if lateral := sides or solved.side_bounds(np.array([j])):
            speed_sq, limiting, free = lateral.of(0 if sides is None else j, n)
            self.clear_at_side = free - float(profile.station[first, j])
            self.at_side = self._lower(speed_sq[first:], limiting[first:])
            np.minimum(self.track.speed_limit, np.sqrt(self.bound), out=self.track.speed_limit)

    def _stop_before(self, finding: GroundFinding) -> None:
        """End the clear distance where the verifier finding what blocks the path.

        Bounds before it are lowered to stops with the weakest brakes of the way there.
        """
        self.blocked, self.clear, self.barrier = finding, finding.station, finding.bound
        track, errors = self.track, self.errors
        self.barrier_station = k = int(np.searchsorted(track.station, finding.station))
        fastest = float(self.bound.max())
        weakest = min(self.full_braking(i, fastest) for i in range(min(k + 1, len(track.station))))
        dead_time = float(track.dead_time.max()) + errors.latency
        # From the next station, so that v² linear in between stops in time as well.
        ahead = np.append(track.station[1:], np.inf)
        left = self.clear - self.offset - errors.along_track - ahead
        lost = max(weakest, 0.0) * dead_time
        speed = np.sqrt(lost**2 + 2.0 * max(weakest, 0.0) * np.maximum(left, 0.0)) - lost
        self._lower(np.square(np.maximum(speed - errors.speed, 0.0)), int(finding.bound))

    def _lower(self, speed_sq: Floats, limiting: Ints | int) -> Bools:
        """Lower the bounds to v² (N,), and name what says so; stations where that is lower."""
        is_lower: Bools = speed_sq < self.bound
        np.copyto(self.label, limiting, where=is_lower)
        np.copyto(self.bound, speed_sq, where=is_lower)
        self.speed_sq_max = self.bound.copy()
        return is_lower

    def lower_where_broken(self, k: Ints, speed_sq: Floats, broken: Ints) -> None:
        """Lower the bounds at stations to v² by what the verifier found broken there, and name it.

        What breaks a limit of the speed itself keeps its name. Changes of speed that are too fast
        lower what is planned, not the highest speed.
        """
        self.bound[k] = speed_sq
        self.label[k] = np.where(broken == Limiting.SPEED_LIMIT, self.label[k], broken)
        holds = ~np.isin(broken, (Limiting.ACCEL, Limiting.DECEL))
        self.speed_sq_max = self.speed_sq_max.copy()
        self.speed_sq_max[k[holds]] = np.minimum(self.speed_sq_max, self.bound)[k[holds]]

    def highest_verified(self, speed_sq: Floats, label: Ints) -> tuple[Floats, Ints]:
        """Highest v² (N,) up to which the verifier passes held speeds from a profile on [m²/s²].

        And the label of the profile (N,), by what is broken where nothing above it passes.

        Bounds take a stop by chords and tangents, and do not know every turn that one from a higher
        speed than planned comes to; from a still higher one it may brake behind the turn.
        """
        beyond, terms = beyond_of(self._barrier), self._terms
        highest, broken = core.raise_held(
            self.track, speed_sq, self.speed_sq_max, self.clear, self.offset, beyond, _TRIED, terms
        )
        names_it = (broken >= 0) & (broken != Limiting.SPEED_LIMIT)
        return highest, np.where(names_it, broken, label)

    @property
    def _barrier(self) -> Limiting | None:
        """Bound of the ground before which the verifier alone ends the clear distance."""
        return None if self.blocked is None else self.barrier

    @property
    def obstacle(self) -> Obstacle | None:
        """Obstacle of wheels or body, where that ends the clear distance."""
        if self.barrier_station >= len(self.track.station):
            return None
        j, first = self._index
        met = self._hazards.obstacle(j, first + self.barrier_station)
        return met if met is not None and met.bound is self.barrier else None

    @cached_property
    def momentum(self) -> Momentum | None:
        """Requirements of a hill that ends the clear distance because thrust alone cannot climb it.

        None also where ground beyond it is unknown, or steeper than the model was trained on.
        """
        k = self.barrier_station
        if self.barrier is not Limiting.TRACTION or k >= len(self.track.station):
            return None
        braking = self.model.braking
        low, high = braking.grade_range
        drivable = self.known & (self.track.grade >= low) & (self.track.grade <= high)
        ends = np.flatnonzero(~(self.known if braking.extrapolate else drivable)[k:])
        reach = k + int(ends[0]) if len(ends) else len(self.track.station)
        run_up = momentum_over(self.track, max(k - 1, 0), reach, self.scalars)
        # How the hill continues on unknown ground is not known.
        ends_there = run_up is not None and run_up.until >= self.track.station[reach - 1]
        return None if ends_there and len(ends) else run_up

    def verify(self, speed_sq: Floats, *, decel: float | None = None) -> Verification:
        """Verify a profile (N,) exactly; see :func:`slopewise.planner.verify.verifier.check`."""
        terms = self._terms
        if decel is not None:
            terms = terms._replace(limits=terms.limits._replace(decel=decel))
        return check(self.track, speed_sq, self.clear, self.offset, terms, self.even, self._barrier)

    def fastest(self) -> tuple[Floats, bool]:
        """The fastest profile with the fixed prefix; and does service braking get it there?"""
        begin, last = len(self.fixed_prefix) - 1, float(self.fixed_prefix[-1])
        answer, reachable = self.fastest_from(begin, last)
        fits = bool(reachable >= last - ROUNDING)
        if fits:
            answer[0] = last
        return np.concatenate((self.fixed_prefix[:-1], answer)), fits

    def fastest_from(self, begin: int, start_sq: float) -> tuple[Floats, float]:
        """The fastest profile from a station on, and the highest v² it could start with."""
        problem = self.problem.part(slice(begin, None), slice(1))
        answer, reachable = core.time_optimal(problem._replace(start_sq=np.array([start_sq])))
        return answer[:, 0], float(reachable[0])

    def full_braking(self, k: int, speed_sq: float) -> float:
        """Least deceleration of full braking at station k from this v² down [m/s²]."""
        track = self.track
        slow = float(track.slowest[k])
        fast = max(float(np.sqrt(speed_sq)), slow)
        force = min(slow * track.lower_slope[k], fast * track.lower_slope[k])
        force += self.problem.lower_intercept[k, 0]
        return float(GRAVITY * (force + self.problem.sin_grade[k, 0]))

    def rest_at(self, rest: float, k: int) -> None:
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
        station, sine = self.track.station, np.sin(self.track.grade)
        self.problem = self.problem._replace(station=station[:, None], sin_grade=sine[:, None])

    def segment_limits(self, speed_sq: Floats) -> tuple[Floats, Floats]:
        """Accelerations and decelerations allowed on each segment at any speed up to a profile.

        (N − 1,) each, both >= 0 [m/s²].
        """
        return core.segment_limits(self.track, speed_sq, self.problem, self.scalars)

    def limiting(self, speed_sq: Floats, accel: Floats, smoothed: bool) -> Ints:
        """Bound that holds a profile at each station, (N,) codes of :class:`Limiting`.

        Its bound, or how fast the speed may change around it; what neither holds back is jerk.
        """
        limits = self.segment_limits(speed_sq)
        max_accel = self.scalars.accel
        return core.labels(speed_sq, accel, self.bound, self.label, *limits, max_accel, smoothed)
