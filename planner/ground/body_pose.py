"""Where the body is on a path: middle of the wheelbase and heading, as the steering has them.

The steering centre of the body moves straight ahead, so it trails behind the reference point like
the end of a rod of length e: along each straight piece between stations exactly as a tractrix,
tan(β/2) falling by exp(−d/e) over a distance d, with β the angle between the rod and the piece.
"""

from __future__ import annotations

from typing import NamedTuple

from slopewise.models.arrays import Floats
from slopewise.models.steering import SteeringGeometry
from slopewise.planner.compiled_core import core


class BodyRows(NamedTuple):
    """Middle of the wheelbase [m] and unit vector of the body's heading, (N, M) each."""

    x: Floats
    y: Floats
    heading_x: Floats
    heading_y: Floats


def trailing_heading(x: Floats, y: Floats, steering: SteeringGeometry) -> tuple[Floats, Floats]:
    """Unit vectors of the body's heading, (N, M) each, for a reference point ahead of the centre.

    The turn begins steady: with the mean curvature of the first e of the path.

    Args:
        x, y: (N, M) reference points [m], padded with the last one.
        steering: geometry with ``centre_offset`` > 0.
    """
    return core.trailing_heading(x, y, steering.centre_offset)
