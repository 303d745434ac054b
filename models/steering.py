"""How the vehicle turns: body heading on a path, least radius, steering angle.

The reference point of the vehicle stands on the planned line. A *steering centre* is the point of
the body that moves straight ahead: the rear axle of an Ackermann vehicle, the middle of the
wheelbase of one that steers both axles or skids. Definitions: docs/vehicle_motion.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from slopewise.models.arrays import Elementwise
from slopewise.models.errors import ParameterError
from slopewise.models.quantity import positive, validate_quantities

Kind = Literal["skid_steer", "ackermann", "double_ackermann"]

_DEFAULT_MAX_ANGLE = 0.6
"""Greatest steering angle of wheels whose model file has none [rad]: 34°, the lower end of what
off-road vehicles with steered wheels have (34° … 40°): a plan then asks for no turn too many."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Steering:
    """How the vehicle turns, and how tightly and quickly it can."""

    kind: Kind
    reference: Literal["mid", "rear_axle"] = "mid"
    max_angle: float | None = positive(
        "rad",
        "Greatest steering angle of a wheel in the middle of a steered axle; "
        "0.6 by default, where neither it nor min_radius is given.",
        (0.02, 1.4),
        default=None,
        at_most=1.5,
    )
    min_radius: float | None = positive(
        "m",
        "Least radius that the reference point can turn on; instead of max_angle.",
        (0.02, 100.0),
        default=None,
    )
    max_rate: float | None = positive(
        "rad/s",
        "Greatest rate of the steering angle; not limited by default.",
        (0.01, 10.0),  # a fast servo turns 60° in 0.1 s
        default=None,
        at_most=10.0,
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        if self.reference == "rear_axle" and self.kind != "ackermann":
            raise ParameterError("reference", f"'mid' for the kind '{self.kind}', got 'rear_axle'")
        if self.max_angle is not None and self.min_radius is not None:
            raise ParameterError("min_radius", "only one of max_angle and min_radius, got both")
        if self.kind == "skid_steer":
            for name in ("max_angle", "max_rate"):
                if getattr(self, name) is not None:
                    raise ParameterError(name, "no such key for the kind 'skid_steer'")


class SteeringGeometry(NamedTuple):
    """Numbers of one vehicle that decide how it stands on a path.

    Attributes:
        centre_offset: distance e from the steering centre ahead to the reference point [m].
        body_offset: distance from the reference point ahead to mid-wheelbase [m].
        arm: from the steering centre to a steered axle [m]; tan δ = arm · curvature there. 0: no
            wheel is steered.
        max_curvature: largest curvature that the reference point turns on [1/m], or inf.
        max_rate: largest rate of the steering angle [rad/s], or inf.
        assumed: sentence on assumed numbers, empty where the model file has all.
    """

    centre_offset: float = 0.0
    body_offset: float = 0.0
    arm: float = 0.0
    max_curvature: float = math.inf
    max_rate: float = math.inf
    assumed: str = ""


@lru_cache(maxsize=64)
def steering_geometry(
    steering: Steering | None, drive: Literal["skid_steer", "ackermann"], wheelbase: float
) -> SteeringGeometry:
    """Geometry of a vehicle; without a table, as its drive has it.

    Args:
        steering: table of the model file, None where it has none.
        drive: key of the vehicle. wheelbase: L [m].
    """
    given = Steering(kind=drive) if steering is None else steering
    if given.kind == "skid_steer":
        radius = given.min_radius
        return SteeringGeometry(max_curvature=math.inf if radius is None else 1.0 / radius)
    half = 0.5 * wheelbase
    ahead = half if given.kind == "ackermann" and given.reference == "mid" else 0.0
    arm = half if given.kind == "double_ackermann" else wheelbase
    radius, assumed = given.min_radius, ""
    if radius is None:
        angle = _DEFAULT_MAX_ANGLE if given.max_angle is None else given.max_angle
        radius = min_turning_radius(angle, arm, ahead)
        if given.max_angle is None:
            assumed = (
                f"assumed of the steering: {given.kind}, greatest angle {angle:g} rad, least "
                f"radius {radius:.3g} m"
            )
            assumed += "" if given.max_rate is not None else ", no limit of its rate"
    return SteeringGeometry(
        ahead,
        half if given.reference == "rear_axle" else 0.0,
        arm,
        1.0 / radius,
        math.inf if given.max_rate is None else given.max_rate,
        assumed,
    )


def min_turning_radius(max_angle: float, arm: float, centre_offset: float) -> float:
    """Least radius that the reference point turns on [m]: √((arm / tan δ)² + e²).

    Args:
        max_angle: greatest steering angle δ [rad]. arm: as of :class:`SteeringGeometry` [m].
        centre_offset: e, of the reference point ahead of the steering centre [m].
    """
    return math.hypot(arm / math.tan(max_angle), centre_offset)


def body_heading_offset(curvature: Elementwise, centre_offset: float) -> Elementwise:
    """Heading of the path less that of the body in a steady turn [rad]: asin(e κ).

    In a left turn (κ > 0) an Ackermann vehicle points to the right of the tangent of the path that
    the middle of its wheelbase describes. Beyond |e κ| = 1 no vehicle turns: ±π/2.

    Args:
        curvature: κ of the path of the reference point, left turns positive [1/m].
        centre_offset: e [m].
    """
    return np.arcsin(np.clip(curvature * centre_offset, -1.0, 1.0))


def steering_angle(curvature: Elementwise, geometry: SteeringGeometry) -> Elementwise:
    """Steering angle δ in a steady turn, left positive [rad].

    tan δ = arm · κ_c with κ_c = κ / √(1 − e²κ²), the curvature that the steering centre describes.
    """
    offset = body_heading_offset(curvature, geometry.centre_offset)
    return np.arctan2(geometry.arm * curvature, np.cos(offset))
