"""One candidate as the judge walks it: its stations, and what stops meet there.

Loads and sums are those of the laws of `models`, of angles, at every station; planners' shortcuts
in sines have no place here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects.registry import MotionTerms
from slopewise.models.laws import wheel_loads
from slopewise.models.parameters import Model
from slopewise.planner.ground.braking_ground import BrakingGround, StopErrors
from slopewise.planner.ground.forces import Forces
from slopewise.planner.ground.terrain_profile import TerrainProfile, TerrainRows
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.kernels.limits import PlanningLimits

_rear_share = inlined(wheel_loads.rear_load_share)
_front_share = inlined(wheel_loads.front_load_share)
_left_share = inlined(wheel_loads.left_load_share)
_right_share = inlined(wheel_loads.right_load_share)


class Track(NamedTuple):
    """One candidate as the judge walks it; arrays are (N,) over its stations.

    Attributes:
        station, grade, roll, curvature, yaw: geometry; yaw without jumps.
        lower_slope, lower_intercept, upper_slope, upper_intercept, dead_time, slowest: as of the
            ground.
        speed_limit: of path, trained range and rough ground [m/s].
        vertical_curvature: change of the grade, negative over a crest [1/m].
        friction: of the ground, inf where it is not known [1].
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
    slowest: Floats
    speed_limit: Floats
    vertical_curvature: Floats
    friction: Floats


class Body(NamedTuple):
    """The vehicle as the judge weighs it; SI."""

    wheelbase: float
    track_width: float
    cg_x: float
    cg_z: float
    slip_track: float


class SteeringTerms(NamedTuple):
    """Limits of the steering, as of :class:`slopewise.models.steering.SteeringGeometry`."""

    centre_offset: float
    arm: float
    max_curvature: float
    max_rate: float


class Terms(NamedTuple):
    """What plans are judged by.

    Attributes:
        body, limits: of the model. motion: effects on the motion itself. errors: of speed, map,
            place and time. steering: what it can do.
        in_time: something acts on the motion, so stops are integrated in time; those that may slide
            are anyway.
        between: points inside each segment from which a stop is tried as well.
        time_step: of the integrator [s].
        all_loads: the loads of every stop are wanted, not only those that may run short.
    """

    body: Body
    limits: PlanningLimits
    motion: MotionTerms
    errors: StopErrors
    steering: SteeringTerms
    in_time: bool
    between: int
    time_step: float
    all_loads: bool


class StopCommand(NamedTuple):
    """An emergency stop as it is commanded.

    Attributes:
        station, speed: where [m] and at what speed [m/s].
        dead_time: from command to onset [s].
        slowest: below this speed the force no longer changes [m/s].
    """

    station: float
    speed: float
    dead_time: float
    slowest: float


class Survey(NamedTuple):
    """What stops meet at the stations, by the laws of `models`; arrays are (N,).

    Attributes:
        sine: sin θ.
        slope_work: sum of lower_slope from the first station on [m · s/m].
        intercept_work: sum of lower_intercept + sin θ from the first station on [m].
        front, rear, left, right: shares of the level static loads at rest.
        lean: lateral acceleration for each unit of v² [1/m].
        per_accel: by how much acceleration unloads the front, deceleration the rear [s²/m].
        per_decel, per_lateral: the same of the rear and of the sides.
    """

    sine: Floats
    slope_work: Floats
    intercept_work: Floats
    front: Floats
    rear: Floats
    left: Floats
    right: Floats
    lean: Floats
    per_accel: float
    per_decel: float
    per_lateral: float


def track_of(
    profile: TerrainProfile,
    ground: BrakingGround,
    candidate: int,
    speed_limit: Floats | None = None,
    first: int = 0,
) -> Track:
    """One candidate out of a batch, contiguous, without padding and without its first stations."""
    n = int(profile.count[candidate])
    columns = np.empty((len(Track._fields), n - first))
    friction = np.empty((0, 0)) if ground.friction is None else ground.friction
    copy_columns(first, candidate, profile.rows, ground.forces, friction, True, columns)
    track = Track(*columns)
    if speed_limit is not None:
        np.minimum(track.speed_limit, speed_limit[first:n, candidate], out=track.speed_limit)
    return track


@kernel
def copy_columns(
    first: int,
    j: int,
    terrain: TerrainRows,
    forces: Forces,
    friction: Floats,
    turns: bool,
    out: Floats,
) -> None:
    """Stations of candidate j from ``first`` on, in the order of :class:`Track`.

    Args:
        first: stations before it are left out.
        j: the candidate.
        terrain, forces: of the batch; ``forces.fastest`` becomes the speed limit.
        friction: (N, M), or (0, 0) where it is not known.
        turns: False leaves the yaw at 0, where nothing asks for it.
        out: (≥ 14, ≥ count − first).
    """
    for k in range(first, terrain.counts[j]):
        i = k - first
        yaw = np.arctan2(terrain.heading_y[k, j], terrain.heading_x[k, j]) if turns else 0.0
        before = out[4, i - 1] if i > 0 else yaw
        out[0, i] = terrain.station[k, j] - terrain.station[first, j]
        out[1, i] = terrain.grade[k, j]
        out[2, i] = np.arcsin(terrain.sin_roll[k, j])
        out[3, i] = terrain.curvature[k, j]
        out[4, i] = yaw - 2.0 * np.pi * np.round((yaw - before) / (2.0 * np.pi))
        out[5, i] = forces.lower_slope[k, j]
        out[6, i] = forces.lower_intercept[k, j]
        out[7, i] = forces.upper_slope[k, j]
        out[8, i] = forces.upper_intercept[k, j]
        out[9, i] = forces.dead_time[k, j]
        out[10, i] = forces.slowest[k, j]
        out[11, i] = forces.fastest[k, j]
        out[12, i] = terrain.vertical_curvature[k, j]
        out[13, i] = friction[k, j] if friction.shape[0] > 0 else np.inf


def body_of(model: Model) -> Body:
    """The vehicle's numbers for the judge."""
    v = model.vehicle
    rim = model.terrain.slip_track if v.drive == "skid_steer" else v.track_width
    return Body(v.wheelbase, v.track_width, v.cg_x, v.cg_z, rim)


@kernel
def survey_of(track: Track, body: Body, memory: Floats) -> Survey:
    """Walk a track once; ``memory`` is (8, ≥ N)."""
    n = track.station.shape[0]
    survey = Survey(
        memory[0],
        memory[1],
        memory[2],
        memory[3],
        memory[4],
        memory[5],
        memory[6],
        memory[7],
        _front_share(0.0, 0.0, 0.0, body.wheelbase, body.cg_x, body.cg_z)
        - _front_share(0.0, 0.0, -1.0, body.wheelbase, body.cg_x, body.cg_z),
        _rear_share(0.0, 0.0, 0.0, body.wheelbase, body.cg_x, body.cg_z)
        - _rear_share(0.0, 0.0, 1.0, body.wheelbase, body.cg_x, body.cg_z),
        _left_share(0.0, 0.0, 0.0, body.track_width, body.cg_z)
        - _left_share(0.0, 0.0, 1.0, body.track_width, body.cg_z),
    )
    for k in range(n):
        grade, roll = track.grade[k], track.roll[k]
        survey.sine[k] = np.sin(grade)
        survey.front[k] = _front_share(grade, roll, 0.0, body.wheelbase, body.cg_x, body.cg_z)
        survey.rear[k] = _rear_share(grade, roll, 0.0, body.wheelbase, body.cg_x, body.cg_z)
        survey.left[k] = _left_share(grade, roll, 0.0, body.track_width, body.cg_z)
        survey.right[k] = _right_share(grade, roll, 0.0, body.track_width, body.cg_z)
        survey.lean[k] = track.curvature[k] / np.cos(roll)
    survey.slope_work[0] = survey.intercept_work[0] = 0.0
    for k in range(n - 1):
        ds = track.station[k + 1] - track.station[k]
        turn = 0.5 * (track.grade[k + 1] - track.grade[k])
        # The mean of sin θ over a linear grade is that of its ends times tan(turn) / turn.
        t = turn * turn
        mean = 0.5 * (survey.sine[k] + survey.sine[k + 1]) * (1.0 + t / 3.0 + t * t * 2.0 / 15.0)
        slope = 0.5 * (track.lower_slope[k] + track.lower_slope[k + 1])
        intercept = 0.5 * (track.lower_intercept[k] + track.lower_intercept[k + 1]) + mean
        survey.slope_work[k + 1] = survey.slope_work[k] + ds * slope
        survey.intercept_work[k + 1] = survey.intercept_work[k] + ds * intercept
    return survey


@inlined
def at(values: Floats, i: int, u: float) -> float:
    """Linear between stations i and i + 1."""
    return float(values[i] + u * (values[i + 1] - values[i]))


@inlined
def segment(station: Floats, s: float, i: int) -> int:
    """Index of the segment that holds s, walking from i."""
    while i > 0 and station[i] > s:
        i -= 1
    while i + 2 < station.shape[0] and station[i + 1] <= s:
        i += 1
    return i
