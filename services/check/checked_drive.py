"""A plan on its ground, as all checks take it, and what its turns ask of the steering.

With β between line and body the steering gives the curvature κ_s = sin β / e, by the angle
δ = atan(a κ_s / cos β) of wheels a distance a ahead of the steering centre; where that stands on
the line, κ_s is the curvature of the line. Source: docs/vehicle_motion.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Model
from slopewise.models.steering import SteeringGeometry
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.obstacle_checks import Struck
from slopewise.services.check.path_ground import LineGround
from slopewise.services.check.plan_line import Line
from slopewise.services.check.stop_dynamics import StopDynamics


class Turning(NamedTuple):
    """Demands on the steering at M samples; arrays are (M,).

    The first heading of the body is assumed: both are lower by the share that is uncertain.
    """

    curvature: Floats  # κ_s [1/m]
    rate: Floats  # change of the steering angle along the line, at rows the larger one [rad/m]


def turning_along(line: Line, geometry: SteeringGeometry) -> Turning:
    """Demands of a line on the steering."""
    curvature, cosine, rod = line.curvature, np.ones_like(line.flat), geometry.centre_offset
    if rod > 0.0:
        beta = line.heading - line.body.heading
        curvature, cosine = np.sin(beta) / rod, np.cos(beta)
    share = 1.0 / (1.0 + line.body.start_error)
    rows = line.at_row
    angle = np.arctan2(geometry.arm * curvature, cosine)[rows]
    change = np.abs(np.diff(angle)) / np.diff(line.flat[rows])
    rate = np.append(change, 0.0)[line.row]
    rate[rows[1:]] = np.maximum(rate[rows[1:]], change)
    return Turning(share * curvature, share * rate)


def too_tight(turning: Turning, model: Model) -> Struck:
    """Turns tighter than the vehicle can; nothing blocks the first place, where it stands."""
    max_curvature = model.steering_geometry.max_curvature
    needed = np.abs(turning.curvature)
    needed[0] = 0.0
    sentence = f"turns by {{0:.3f}} 1/m, {max_curvature:.3f} 1/m is the most that steering gives"
    return Struck("turning", needed / max_curvature - 1.0, sentence, needed)


class CheckedDrive(NamedTuple):
    """A plan of N rows, and its ground at M samples."""

    plan: ExternalPlan
    line: Line
    ground: LineGround
    field: StopDynamics
    turning: Turning
    clear: Floats  # (M,) station before which stops end [m]
