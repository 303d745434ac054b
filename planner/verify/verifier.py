"""Verifier of a finished plan: is every constraint kept, at the stations and between them?

It shares no approximation with what made the plan: bounds work with tangents and chords of v² and
with sums of sines, the verifier (`core/verify/verify.hpp`) follows every emergency stop to its
end, on the laws of `models`. The third writing of a stop,
:mod:`slopewise.models.stops.simulation`, is what tests compare both with.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import SpeedBounds
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.limiting import Limiting
from slopewise.planner.verify.terms import Terms, terms_of


class Track(NamedTuple):
    """One candidate as the verifier walks it; arrays are (N,) over its stations.

    Attributes:
        station, grade, roll, curvature, yaw: geometry; yaw without jumps.
        lower_slope, lower_intercept, upper_slope, upper_intercept, dead_time,
            shortest_dead_time, slowest: those of the ground.
        speed_limit: of path, trained range and rough ground [m/s].
        vertical_curvature: change of the grade, negative over a crest [1/m].
        friction: the ground's, inf where it is not known [1].
    """

    station: Floats
    grade: Floats
    roll: Floats
    curvature: Floats
    yaw: Floats
    lower_slope: Floats
    lower_intercept: Floats
    upper_slope: Floats
    upper_intercept: Floats
    dead_time: Floats
    shortest_dead_time: Floats
    slowest: Floats
    speed_limit: Floats
    vertical_curvature: Floats
    friction: Floats


def track_of(
    profile: TerrainProfile,
    ground: BrakingGround,
    candidate: int,
    speed_limit: Floats | None = None,
    first: int = 0,
) -> Track:
    """One candidate from a batch, without its first stations.

    Args:
        profile, ground: those of the batch.
        candidate: its index.
        speed_limit: (N, M) limits of the paths themselves [m/s].
        first: stations at the beginning that are omitted.
    """
    n = int(profile.count[candidate])
    track = Track(*core.copy_track(profile, ground, ground.fastest, candidate, first))
    if speed_limit is not None:
        np.minimum(track.speed_limit, speed_limit[first:n, candidate], out=track.speed_limit)
    return track


class Violations(NamedTuple):
    """The worst breach of each kind: by how much, in the unit of what is breached; 0 without one.

    In the order of the core, which returns them as one array.
    """

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
    unknown_terrain: float
    model_validity: float
    holding: float
    step: float
    clearance: float
    body: float

    @property
    def beyond_ground(self) -> tuple[float, ...]:
        """By how much stops end beyond ground of each kind [m]."""
        trained = self.unknown_terrain, self.model_validity, self.holding
        return *trained, self.step, self.clearance, self.body


@dataclass(frozen=True, slots=True)
class Verification:
    """Findings of the verifier.

    Attributes:
        stop_distance: (N,) emergency stop from each station at its speed, with its safety offset;
            0 where the plan stands [m].
        rear_load: (N,) least rear axle load on that stop, as share of its level static load.
        side_load: (N,) least side load on that stop, as share of half the weight.
        violation: the worst breaches, all 0 for a valid plan.
        where: segments in or at the start of which something is breached. broken: a bound that is,
            of each, codes of :class:`Limiting`; ``SPEED_LIMIT`` for any limit of the speed itself.
    """

    stop_distance: Floats
    rear_load: Floats
    side_load: Floats
    violation: Violations
    where: Ints
    broken: Ints

    @property
    def overrun(self) -> float:
        """Distance of any stop's end beyond the clear distance, for any cause [m]."""
        return max(self.violation.overrun, *self.violation.beyond_ground)

    @property
    def valid(self) -> bool:
        """No constraint is breached."""
        return max(self.violation) <= 0.0


def check(
    track: Track,
    speed_sq: Floats,
    clear_distance: float,
    distance_offset: float,
    terms: Terms,
    even: Track | None = None,
    barrier: Limiting | None = None,
) -> Verification:
    """Judge one plan.

    Args:
        track: the candidate, with what crests and friction leave of the braking force.
        speed_sq: (N,) v², linear between stations [m²/s²].
        clear_distance: station before which every stop must end [m].
        distance_offset: safety offset of the model [m].
        terms: vehicle, limits and errors; their deceleration is inf for an emergency.
        even: the candidate with the whole of the force, for the stops that are reported; the
            same if omitted.
        barrier: bound of the ground that ends the clear distance, where the verifier itself found
            it: a stop that ends beyond counts as a violation of that.

    Nothing raises: what is not a number, or does not stop, is a breach by infinity.
    """
    beyond = beyond_of(barrier)
    (stop_distance, rear_load, side_load), worst, broken = core.verify(
        track, even or track, speed_sq, clear_distance, distance_offset, beyond, terms
    )
    violations = Violations(*worst.tolist())
    where = np.flatnonzero(broken >= 0)
    return Verification(stop_distance, rear_load, side_load, violations, where, broken[where])


def beyond_of(barrier: Limiting | None) -> int:
    """Index of the violation that a stop beyond the clear distance is; see `check`."""
    return Violations._fields.index("overrun" if barrier is None else barrier.label)


def screen(
    profile: TerrainProfile,
    ground: BrakingGround,
    bounds: SpeedBounds,
    speed_sq: Floats,
    model: Model,
    speed_limit: Floats | None = None,
    rough_speed: Floats | None = None,
    lanes: Ints | None = None,
) -> Floats:
    """Verify M profiles of up to N stations, without the columns of a plan file.

    Args:
        profile, ground, bounds: those of the batch.
        speed_sq: (N, M) v² [m²/s²].
        model: vehicle and limits.
        speed_limit: (N, M) limits of the paths themselves [m/s].
        rough_speed: (N, M) limits of rough ground [m/s].
        lanes: indices of those that are verified; None: all.

    Returns:
        (M, 19) worst breaches in the order of :class:`Violations`, 0 without one.
    """
    limit = ground.fastest
    for bound in (speed_limit, rough_speed):
        limit = limit if bound is None else np.minimum(limit, bound)
    terms = terms_of(model, ground.motion, ground.errors, all_loads=False)
    lanes = np.arange(len(profile.count)) if lanes is None else lanes
    return core.verify_batch(profile, ground, limit, speed_sq, bounds.clear_distance, terms, lanes)
