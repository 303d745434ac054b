"""Numbers of a model for the compiled verifier."""

from __future__ import annotations

from typing import NamedTuple

from slopewise.models.effects import registry
from slopewise.models.effects.registry import MotionTerms
from slopewise.models.parameters import Model
from slopewise.planner.ground.braking_ground import StopErrors
from slopewise.planner.planning_limits import PlanningLimits, planning_limits

TIME_STEP = 0.02
"""Step of the integrator in time [s]; halving it moves a stop by less than 10 µm."""

BETWEEN = 3
"""Points inside each segment from which a stop is tried as well."""


class Body(NamedTuple):
    """The vehicle as the verifier weighs it; SI."""

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
    """Numbers that plans are verified with.

    Attributes:
        body, limits: those of the model. motion: effects on the motion itself. errors: speed, map,
            place and time. steering: what it can do.
        in_time: something acts on the motion, so stops are integrated in time; those that may slide
            are anyway.
        between: points inside each segment from which a stop is tried as well.
        time_step: step of the integrator [s].
        all_loads: the loads of every stop are required, not only those that may run short.
        changes: changes of speed and steering angle are judged, too.
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
    changes: bool = True


def terms_of(
    model: Model, motion: MotionTerms, errors: StopErrors, *, all_loads: bool = True
) -> Terms:
    """Terms of a model with these effects on the motion and these errors."""
    v, geometry = model.vehicle, model.steering_geometry
    rim = model.terrain.slip_track if v.drive == "skid_steer" else v.track_width
    return Terms(
        Body(v.wheelbase, v.track_width, v.cg_x, v.cg_z, rim),
        planning_limits(model),
        motion,
        errors,
        SteeringTerms(
            geometry.centre_offset, geometry.arm, geometry.max_curvature, geometry.max_rate
        ),
        motion != registry.NO_MOTION._replace(heat=motion.heat),
        BETWEEN,
        TIME_STEP,
        all_loads,
    )
