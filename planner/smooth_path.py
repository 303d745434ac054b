"""The smooth curve that a polyline means, on even stations; or itself, with rounded corners.

A parametric smoothing spline (FITPACK's) goes through the polyline, as stiff as its noise asks for
and as close to its corners as their distance says that they are meant. What is around FITPACK is
compiled: a question brings dozens of paths, and each is only a hundred points long.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import splprep

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.planner.kernels.compiled import inlined, kernel

_ROUNDING = 0.03  # [m] how far a corner between distant vertices may be rounded off
_ROUNDING_SHARE = 0.02  # the same as a share of the distance between vertices
_SHARP = 0.5  # [rad] corners that turn less are rounded off less
_FINEST = 2e-4  # [m] a polyline is never taken to be more exact than this
_DENSE = 0.5  # [m] between distant vertices the polyline counts at least this often
_FINER = 4  # pieces of the curve per station whose lengths are added up
_ENDS = 100.0  # the ends of a polyline count so much more than what is between
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
    dense_along, dense, weights = _between_vertices(points, along, stray)
    degree = min(3, len(dense) - 1)
    # Asked for all it knows FITPACK does not warn where it cannot use all of its freedom.
    ((knots, (x, y), _), _), _, fault, words = splprep(
        dense.T, w=weights, u=dense_along, s=len(dense), k=degree, full_output=True
    )
    if fault >= _INVALID:
        raise ParameterError("points", f"a polyline that a spline can follow: {words}")
    return _evenly(knots, x, y, degree, along[-1], count, points[0], points[-1])


def rounded(points: Floats, spacing: float, max_cut: float, most: int) -> Floats:
    """Even stations on a polyline whose corners are arcs, as wide as its pieces allow, (N, 2) [m].

    An arc covers at most half of both pieces that meet at its corner.

    Args:
        points: (n, 2), n >= 3. spacing: of stations at most [m].
        max_cut: how far an arc may lie from its corner [m]. most: stations.
    """
    step = np.diff(points, axis=0)
    length, heading = np.hypot(*step.T), np.arctan2(step[:, 1], step[:, 0])
    turn, tangent = np.zeros((2, len(points)))
    turn[1:-1] = (np.diff(heading) + np.pi) % (2.0 * np.pi) - np.pi
    turn_size = np.maximum(np.abs(turn[1:-1]), 1e-9)
    tangent[1:-1] = np.minimum(
        0.5 * np.minimum(length[1:], length[:-1]), max_cut / np.tan(turn_size / 4.0)
    )
    pieces = np.zeros(2 * len(points) - 1)
    pieces[2:-1:2] = tangent[1:-1] * turn_size / np.tan(turn_size / 2.0)
    pieces[1::2] = np.maximum(length - tangent[:-1] - tangent[1:], 0.0)
    ends = np.cumsum(pieces)
    count = max(int(np.ceil(ends[-1] / spacing - 1e-6)) + 1, 3)
    wanted = np.linspace(0.0, ends[-1], min(count, most))
    piece = np.minimum(np.searchsorted(ends, wanted), len(ends) - 1)
    gone, corner, on_arc = wanted - ends[piece] + pieces[piece], piece // 2, piece % 2 == 0
    # A corner's arc begins before it, in the direction of the piece that ends there.
    ahead = heading[np.clip(corner - on_arc, 0, len(heading) - 1)]
    turned = np.where(on_arc, turn[corner] * gone / np.maximum(pieces[piece], 1e-12), 0.0)
    offset = np.where(on_arc, -tangent[corner], tangent[corner])
    chord, along_chord = gone * np.sinc(turned / (2.0 * np.pi)), ahead + 0.5 * turned
    x = offset * np.cos(ahead) + chord * np.cos(along_chord)
    y = offset * np.sin(ahead) + chord * np.sin(along_chord)
    even: Floats = points[corner] + np.stack((x, y), axis=1)
    return even


@kernel
def _between_vertices(points: Floats, along: Floats, stray: float) -> tuple[Floats, Floats, Floats]:
    """Distances along, places (m, 2) and weights of what the spline is drawn through.

    Between distant vertices a spline would swing out: it is pinned to the polyline in between.
    The farther apart and the sharper its corners, the less a polyline says how they are meant.
    """
    n = points.shape[0]
    most = n + int(along[-1] / _DENSE) + 1
    dense_along, dense, weights = np.empty(most), np.empty((most, 2)), np.empty(most)
    m, between = 0, 0
    turn = 0.0
    dx, dy = points[1, 0] - points[0, 0], points[1, 1] - points[0, 1]
    for i in range(n - 1):
        length, turn_next = along[i + 1] - along[i], 0.0
        if i + 2 < n:
            dx_next = points[i + 2, 0] - points[i + 1, 0]
            dy_next = points[i + 2, 1] - points[i + 1, 1]
            turn_next = abs(math.atan2(dx * dy_next - dy * dx_next, dx * dx_next + dy * dy_next))
            dx, dy = dx_next, dy_next
        sharpness = min(max(turn, turn_next) / _SHARP, 1.0)
        rounding = min(_ROUNDING_SHARE * length * sharpness, _ROUNDING)
        weight = 1.0 / max(stray, rounding, _FINEST)
        turn = turn_next
        at = along[i]
        while at < along[i + 1]:
            share = (at - along[i]) / length
            dense_along[m], weights[m] = at, weight
            for axis in range(2):
                dense[m, axis] = points[i, axis] + share * (points[i + 1, axis] - points[i, axis])
            m += 1
            while between * _DENSE <= at:
                between += 1
            at = between * _DENSE
    dense_along[m], weights[m] = along[-1], weights[m - 1]
    dense[m] = points[-1]
    weights[0] *= _ENDS
    weights[m] *= _ENDS
    return dense_along[: m + 1], dense[: m + 1], weights[: m + 1]


@kernel
def _evenly(
    knots: Floats,
    x: Floats,
    y: Floats,
    degree: int,
    length: float,
    count: int,
    first: Floats,
    last: Floats,
) -> Floats:
    """Stations at even distances along a spline whose parameter runs from 0 to ``length``.

    Its own length differs a little from the polyline's that its parameter is.
    """
    pieces = _FINER * count
    arc = np.empty(pieces + 1)
    arc[0] = 0.0
    local = np.empty((degree + 1, 2))
    span = degree
    x_before, y_before, span = _at(knots, x, y, degree, span, 0.0, local)
    for i in range(1, pieces + 1):
        x_here, y_here, span = _at(knots, x, y, degree, span, length * i / pieces, local)
        arc[i] = arc[i - 1] + math.hypot(x_here - x_before, y_here - y_before)
        x_before, y_before = x_here, y_here
    even = np.empty((count, 2))
    even[0], even[-1] = first, last
    span, i = degree, 0
    for j in range(1, count - 1):
        wanted = arc[-1] * j / (count - 1)
        while arc[i + 1] < wanted:
            i += 1
        parameter = length * (i + (wanted - arc[i]) / (arc[i + 1] - arc[i])) / pieces
        even[j, 0], even[j, 1], span = _at(knots, x, y, degree, span, parameter, local)
    return even


@inlined
def _at(
    knots: Floats, x: Floats, y: Floats, degree: int, span: int, parameter: float, local: Floats
) -> tuple[float, float, int]:
    """A place on a spline, by de Boor's rule, and the knot before it, looked for from ``span``."""
    while span + 1 < x.shape[0] and knots[span + 1] <= parameter:
        span += 1
    for i in range(degree + 1):
        local[i, 0], local[i, 1] = x[span - degree + i], y[span - degree + i]
    for level in range(1, degree + 1):
        for i in range(degree, level - 1, -1):
            low, high = knots[span - degree + i], knots[span + 1 + i - level]
            share = (parameter - low) / (high - low)
            for axis in range(2):
                local[i, axis] = (1.0 - share) * local[i - 1, axis] + share * local[i, axis]
    return local[degree, 0], local[degree, 1], span
