"""The smooth curve that a polyline means, on even stations.

A parametric smoothing spline (FITPACK's) goes through the polyline, as stiff as its noise asks for
and as close to its corners as their distance says that they are meant. What is around FITPACK is
compiled: a question brings dozens of paths, and each is only a hundred points long.
"""

from __future__ import annotations

from scipy.interpolate import splprep

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.planner.compiled_core import core

_INVALID = 10  # FITPACK's word for input that it does not take


def smooth(points: Floats, along: Floats, count: int, stray: float) -> Floats:
    """Even stations on the smooth curve through a polyline.

    Args:
        points: (n, 2) vertices, n >= 3, no two in a row at one place [m].
        along: (n,) distance along the polyline from its first vertex [m].
        count: of stations wanted, N >= 2. stray: noise of the vertices [m].

    Returns:
        (N, 2) stations, equally far apart along the curve; the first and the last are the
        polyline's own ends [m].
    """
    n, dense_along, dense, weights = core.dense_places(points, along, stray)
    degree = min(3, n - 1)
    # Asked for all it knows FITPACK does not warn where it cannot use all of its freedom.
    ((knots, (x, y), _), _), _, fault, words = splprep(
        dense[:n].T, w=weights[:n], u=dense_along[:n], s=n, k=degree, full_output=True
    )
    if fault >= _INVALID:
        raise ParameterError("points", f"a polyline that a spline can follow: {words}")
    return core.spline_stations(knots, x, y, degree, along[-1], points[0], points[-1], count)
