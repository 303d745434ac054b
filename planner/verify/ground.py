"""Ground that blocks a candidate, judged once more from the map alone.

Unknown ground, slopes beyond the trained range or on which the vehicle is not held, steps, and
ground that reaches underside or body block a path. The bounds end the clear distance before them;
`planner/core/verify/verify_ground.hpp` looks for them with separate heights, poses and rules, at
stations and between.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import InputErrors
from slopewise.models.parameters import Model
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.limiting import Limiting


class GroundLimits(NamedTuple):
    """Trained slopes [rad], lateral error [m] and [m²], sine of the heading error [1]."""

    grade_low: float
    grade_high: float
    roll_low: float
    roll_high: float
    across: float
    across_per_curvature: float
    turned: float


class GroundKind(IntEnum):
    """Kinds of places, in the order of `GroundKind` of the core."""

    NONE = 0
    UNKNOWN = 1
    UNTRAINED = 2
    HOLDING = 3
    STEP = 4
    TWIST = 5
    CLEARANCE = 6
    BODY = 7


class BodySizes(NamedTuple):
    """Sizes of body and wheels, and offsets of the steering [m]."""

    wheelbase: float
    track_width: float
    wheel_radius: float
    wheel_width: float
    front: float
    rear: float
    width: float
    clearance: float
    max_step: float
    wheel_travel: float
    centre_offset: float
    body_offset: float


class GroundFinding(NamedTuple):
    """The first place that blocks a candidate.

    Attributes:
        kind: of :class:`GroundKind`.
        station: where the vehicle is then [m].
        value: height, slope or lacking force [m], [rad], [1].
        x, y: position of the obstacle [m].
    """

    kind: GroundKind
    station: float
    value: float
    x: float
    y: float

    @property
    def bound(self) -> Limiting:
        """Bound that it belongs to."""
        return _BOUNDS[self.kind]

    def sentence(self, model: Model) -> str:
        """Obstacle, its place and the limit that it passes."""
        shape = model.vehicle.shape
        clearance = f"the clearance is {shape.clearance:.3g} m"
        obstacle = {
            GroundKind.UNKNOWN: "unknown ground",
            GroundKind.UNTRAINED: f"an untrained slope of {math.degrees(self.value):.1f}°",
            GroundKind.HOLDING: f"a slope that lacks {self.value:.3f} of the weight to be held on",
            GroundKind.STEP: f"a step of {self.value:.2f} m beyond the slope around it, "
            f"the limit is {shape.max_step:.3g} m",
            GroundKind.TWIST: f"a wheel {self.value:.2f} m in the air, its travel is "
            f"{shape.wheel_travel:.3g} m",
            GroundKind.CLEARANCE: f"ground {self.value:.2f} m high between the wheels, {clearance}",
            GroundKind.BODY: f"ground {self.value:.2f} m high under the body, {clearance}",
        }[self.kind]
        where = f"at x {self.x:.2f} m, y {self.y:.2f} m"
        return f"ahead at {self.station:.2f} m {obstacle}, {where} (found by the verifier alone)"


_BOUNDS = {
    GroundKind.UNKNOWN: Limiting.UNKNOWN_TERRAIN,
    GroundKind.UNTRAINED: Limiting.MODEL_VALIDITY,
    GroundKind.HOLDING: Limiting.HOLDING,
    GroundKind.STEP: Limiting.STEP,
    GroundKind.TWIST: Limiting.STEP,
    GroundKind.CLEARANCE: Limiting.CLEARANCE,
    GroundKind.BODY: Limiting.BODY,
}


def first_blocked(
    grid: ElevationMap,
    errors: InputErrors,
    profile: TerrainProfile,
    ground: BrakingGround,
    model: Model,
    candidate: int,
    reach: tuple[int, float],
) -> GroundFinding | None:
    """The first place of a candidate that the vehicle must not come to, None without one.

    Args:
        grid: the map that wheels feel. errors: of tracking, to survive.
        profile, ground: those of the batch; only positions, stations, curvature and braking force
            at rest are used.
        model: vehicle and braking.
        candidate: index in the batch.
        reach: index of the station where the vehicle stands, where nothing blocks it, and the last
            station to check [m].
    """
    first, end = reach
    kind, *where = core.first_blocked(
        grid.elevation,
        *grid.origin,
        grid.resolution,
        body_sizes(model),
        profile,
        ground,
        candidate,
        ground_limits(model, errors),
        first,
        end,
    )
    return None if kind == GroundKind.NONE else GroundFinding(GroundKind(kind), *where)


def ground_limits(model: Model, errors: InputErrors) -> GroundLimits:
    """Slopes that any surface is trained on, unlimited if it extrapolates; errors of tracking."""
    braking, surfaces = model.braking, model.braking.terrain.values()
    (low, high), (roll_low, roll_high) = (
        (-np.inf, np.inf) if braking.extrapolate else (min(lows), max(highs))
        for lows, highs in (
            zip(base, *filter(None, ranges), strict=True)
            for base, ranges in (
                (braking.grade_range, (s.grade_range for s in surfaces)),
                (braking.trained_roll, (s.roll_range for s in surfaces)),
            )
        )
    )
    across = errors.cross_track, errors.cross_track_per_curvature
    return GroundLimits(low, high, roll_low, roll_high, *across, math.sin(errors.heading))


def body_sizes(model: Model) -> BodySizes:
    """Sizes of a vehicle."""
    vehicle, shape, geometry = model.vehicle, model.vehicle.shape, model.steering_geometry
    return BodySizes(
        vehicle.wheelbase,
        vehicle.track_width,
        vehicle.wheel_radius,
        shape.wheel_width,
        shape.front,
        shape.rear,
        shape.width,
        shape.clearance,
        shape.max_step,
        shape.wheel_travel,
        geometry.centre_offset,
        geometry.body_offset,
    )
