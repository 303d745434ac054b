"""Candidate paths: from a given polyline to even stations with a usable curvature.

A polyline may be noisy, hold duplicate points or kinks between distant vertices; differentiated
twice it would be useless. So it is cleaned first, and a smooth curve is drawn through it. Where
that curve is farther from the polyline than allowed, or not as curved as a vehicle turns that
follows the points themselves, the line of that vehicle is planned on; a path that cannot be
followed is refused: none is replaced by another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import splprep

from slopewise.models.arrays import Floats, Ints
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.planner.compiled_core import core
from slopewise.planner.followed_line import (
    MAX_STATIONS,
    MIN_STATIONS,
    GivenPoints,
    LaidLine,
    LineLimits,
)
from slopewise.planner.path_deviation import GivenPolyline, follower_offset, too_far_error
from slopewise.planner.raw_polyline import arc, clean, first_cusp, without_noise

_THINNED = 0.2
"""Share of the distance of stations within which given points are averaged [1]."""

_LEFT_NOISE = 1.2
"""Distance of a smooth curve from noisy points, in their estimated noise [1]: the estimate is off
by some percent, and a curve that follows some of the noise bends several times as much."""

_INVALID = 10  # FITPACK's word for input that it does not take

_ANY_LINE = LineLimits()


@dataclass(frozen=True, slots=True)
class EvenPath:
    """One candidate on even stations, made once by :func:`resample`.

    Attributes:
        name: identifier of the candidate.
        points: (N, 2) stations, N >= 3, the first and last of them those of the polyline [m].
        speed_limit: (N,) the lowest of the polyline's limits around each station [m/s], or
            None.
        given: the polyline itself; None if the stations are what was given.
        follower_offset: (N,) distance of a vehicle that follows the polyline [m], None without any.
    """

    name: str
    points: Floats
    speed_limit: Floats | None
    given: GivenPolyline | None = None
    follower_offset: Floats | None = None


@dataclass(frozen=True, slots=True)
class PathBatch:
    """M candidates on even stations, station-major and padded with their last point.

    Attributes:
        names: (M,) of the candidates.
        rows: (4, N, M) x and y [m]; speed limit, else inf [m/s]; distance of a
            vehicle that follows the polyline, 0 without one [m].
        count: (M,) stations of each candidate.
        given: (M,) the polylines, None for those whose stations are what was given; empty if all
            are.
    """

    names: tuple[str, ...]
    rows: Floats
    count: Ints
    given: tuple[GivenPolyline | None, ...] = ()

    @classmethod
    def of_stations(cls, names: tuple[str, ...], x: Floats, y: Floats, count: Ints) -> PathBatch:
        """Stations (N, M) alone, without limits."""
        return cls(names, np.stack((x, y, np.full_like(x, np.inf), np.zeros_like(x))), count)

    @property
    def x(self) -> Floats:
        """(N, M) [m]."""
        row: Floats = self.rows[0]
        return row

    @property
    def y(self) -> Floats:
        """(N, M) [m]."""
        row: Floats = self.rows[1]
        return row

    @property
    def speed_limit(self) -> Floats:
        """(N, M) [m/s], inf without one."""
        row: Floats = self.rows[2]
        return row

    @property
    def follower_offset(self) -> Floats | None:
        """(N, M) distance of a vehicle that follows the polyline [m], None if it is 0."""
        return self.rows[3] if self.rows[3].any() else None

    def only(self, usable: Ints) -> PathBatch:
        """Some of the candidates, by their indices (m,)."""
        names = tuple(self.names[j] for j in usable)
        given = tuple(self.given[j] for j in usable) if self.given else ()
        return PathBatch(names, self.rows.take(usable, axis=2), self.count[usable], given)

    def given_points(self, j: int) -> Floats:
        """(n, 2) points that were given for a candidate [m]."""
        given = self.given[j] if self.given else None
        if given is not None:
            return given.points
        return np.ascontiguousarray(self.rows[:2, : self.count[j], j].T)


def joined(paths: PathBatch, last: PathBatch) -> PathBatch:
    """Two batches in one, (max N, M + M'), candidates of ``last`` at the end, stations alone."""
    parts = (paths, last)
    steps = np.arange(max(len(part.x) for part in parts))
    padded = [part.rows.take(np.minimum(steps, len(part.x) - 1), axis=1) for part in parts]
    count = np.concatenate([part.count for part in parts])
    return PathBatch(paths.names + last.names, np.concatenate(padded, axis=2), count)


def resample(
    path: CandidatePath | EvenPath, spacing: float, limits: LineLimits = _ANY_LINE
) -> EvenPath:
    """Even stations along a path, up to where it turns round; one that has them is unchanged.

    Args:
        path: polyline.
        spacing: requested distance between stations in the plan view [m].
        limits: how far the line may be from the polyline, and who follows it.

    Returns:
        N >= 3 even points [m], first and last those of the polyline, and (N,) speed limits [m/s],
        each the lowest of the polyline's limits around the station.

    Raises:
        ParameterError: too short, too long, or driven backwards; more stations than
            ``MAX_STATIONS``; or no line keeps within ``limits``.
    """
    if isinstance(path, EvenPath):
        if path.given is not None and path.given.deviation > limits.deviation:
            raise too_far_error(path.given.points, path.points, limits.deviation)
        return path
    reach = _THINNED * spacing
    points, limit, raw, ends = clean(path.points, path.speed_limit, path.yaw, reach)
    along = arc(points)
    laid = _line_along(raw, points, along, spacing, limits)
    if limit is not None:
        limit = _lowest_around(laid.place, along / along[-1], limit)
    if laid.speed_limit is not None:
        limit = laid.speed_limit if limit is None else np.minimum(limit, laid.speed_limit)
    given = GivenPolyline(raw, float(laid.deviation.max()), ends)
    offset = None
    if len(points) > 2:
        share = along / along[-1]
        matched = np.stack([np.interp(laid.place, share, axis) for axis in points.T], axis=1)
        size = limits.wheelbase, limits.overhang
        offset = follower_offset(laid.deviation, laid.points, matched, *size)
    return EvenPath(path.name, laid.points, limit, given, offset)


def _line_along(
    raw: Floats, points: Floats, along: Floats, spacing: float, limits: LineLimits
) -> LaidLine:
    """Stations on the smooth curve if that suits who follows the points, else on their own line.

    Args:
        raw: (m, 2) points that were given [m]; what is planned must be close to them.
        points: (n, 2) those that are left of them; along: (n,) arc of them [m].
        spacing: of stations [m]; limits: to be kept.
    """
    even, place = _smoothed(points, along, spacing)
    if len(points) == 2:
        return LaidLine(even, place, np.zeros(len(even)))
    given = GivenPoints(raw, points, along, spacing, limits)
    deviation = core.deviation(raw, even)
    if deviation.max() <= limits.deviation and first_cusp(even) == 0:
        slow = given.speed_limit_on(even)
        if slow is not None:
            return LaidLine(even, place, deviation, slow if np.isfinite(slow).any() else None)
    return given.followed()


def _smoothed(points: Floats, along: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Even stations on the smooth curve that a polyline means, (N, 2) [m], and their places, (N,).

    Places are shares of the polyline [1]. Noise is averaged, which makes it shorter.

    Args:
        points: (n, 2) of the polyline; along: (n,) arc of them [m].
        spacing: of stations [m].
    """
    points, along, noise = without_noise(points, along)
    length = float(along[-1])
    # A length that is a whole number of spacings except for rounding gets no station more.
    count = max(int(np.ceil(length / spacing - 1e-6)) + 1, MIN_STATIONS)
    if count > MAX_STATIONS:
        raise ParameterError(
            "points", f"a path of at most {MAX_STATIONS} stations, got {length:.0f} m"
        )
    place = np.linspace(0.0, length, count) / length
    if len(points) == 2:
        return points[0] + place[:, None] * (points[1] - points[0]), place
    # A parametric smoothing spline (FITPACK's), as stiff as the noise asks for and as close to
    # corners as their distance says that they are meant.
    n, dense_along, dense, weights = core.dense_places(points, along, _LEFT_NOISE * noise)
    degree = min(3, n - 1)
    # Asked for all it knows FITPACK does not warn where it cannot use all of its freedom.
    ((knots, (x, y), _), _), _, fault, message = splprep(
        dense[:n].T, w=weights[:n], u=dense_along[:n], s=n, k=degree, full_output=True
    )
    if fault >= _INVALID:
        raise ParameterError("points", f"a polyline that a spline can follow: {message}")
    ends = along[-1], points[0], points[-1]
    return core.spline_stations(knots, x, y, degree, *ends, count), place


def batch(
    paths: Sequence[CandidatePath | EvenPath], spacing: float, limits: LineLimits = _ANY_LINE
) -> PathBatch:
    """M paths on even stations, side by side, (N, M); see :func:`resample`."""
    return side_by_side([resample(path, spacing, limits) for path in paths])


def side_by_side(paths: Sequence[EvenPath]) -> PathBatch:
    """Paths of different lengths as one batch."""
    count = np.array([len(path.points) for path in paths], np.int64)
    rows = np.zeros((4, int(count.max()), len(paths)))
    rows[2] = np.inf
    for j, (path, n) in enumerate(zip(paths, count, strict=True)):
        rows[:2, :n, j] = path.points.T
        rows[:2, n:, j] = path.points[-1:].T
        for row, values in ((2, path.speed_limit), (3, path.follower_offset)):
            if values is not None:
                rows[row, :n, j] = values
    return PathBatch(tuple(path.name for path in paths), rows, count, tuple(p.given for p in paths))


def _lowest_around(places: Floats, along: Floats, limit: Floats) -> Floats:
    """The lowest limit between the neighbours of each station, (N,).

    A limit holds from its point to the next and from the one before; a plan that is linear in v²
    between two stations then keeps what holds anywhere between them.
    """
    piece = np.append(np.minimum(limit[1:], limit[:-1]), np.inf)
    last = len(along) - 2
    before = np.concatenate((places[:1], places[:-1]))
    after = np.concatenate((places[1:], places[-1:]))
    first = np.clip(np.searchsorted(along, before, side="right") - 1, 0, last)
    end = np.clip(np.searchsorted(along, after, side="left"), first + 1, last + 1)
    lowest: Floats = np.minimum.reduceat(piece, np.stack((first, end), axis=1).ravel())[::2]
    return lowest


def behind_the_front(clear: float | Floats, model: Model, candidates: int = 1) -> Floats:
    """Station up to which the reference point may come: the vehicle's front stays on the free way.

    Args:
        clear: station up to which each path is known to be free, below 0 nothing is; one for all,
            or (M,) [m].
        model: with the front of its vehicle, ahead of the reference point.
        candidates: M.

    Returns:
        (M,) [m].

    Raises:
        ParameterError: neither one number nor one for each candidate.
    """
    if np.shape(clear) not in ((), (1,), (candidates,)):
        expected = f"one distance [m], or {candidates}, one for each candidate"
        raise ParameterError("clear", f"{expected}; got shape {np.shape(clear)}")
    free = np.broadcast_to(np.asarray(clear, np.float64), (candidates,))
    reach: Floats = np.maximum(free - model.front, np.minimum(free, 0.0))
    return reach
