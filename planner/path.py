"""Candidate paths: from a polyline as somebody drew it to even stations with a usable curvature.

A polyline may be noisy, hold duplicate points or kinks between distant vertices; differentiated
twice it would be useless. So it is cleaned first, and a smooth curve is drawn through it. Where
that curve is farther from the polyline than allowed, the points themselves are followed; a path
that cannot be followed is refused: none is replaced by another.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.planner.path_deviation import GivenPolyline, deviation_along
from slopewise.planner.raw_polyline import STRAY, arc, clean, first_cusp, noise, without_noise
from slopewise.planner.smooth_path import rounded, smooth

MAX_STATIONS = 200_000
"""Stations of one candidate: 20 km at 0.1 m. More is a mistake in units."""

_FEWEST = 3
"""Stations that curvature needs [1]."""

_ROUNDED = 0.85
"""Share of the allowed deviation that corners are rounded by: the rest is for the straight lines
between stations, which cut an arc once more [1]."""


@dataclass(frozen=True, slots=True)
class EvenPath:
    """One candidate on even stations, made once by :func:`resample`.

    Attributes:
        name: of the candidate.
        points: (N, 2) stations, N >= 3, the first and last of them those of the polyline [m].
        speed_limit: (N,) the lowest of the polyline's limits around each station [m/s], None if
            there is none.
        given: the polyline itself; None if the stations are what was given.
    """

    name: str
    points: Floats
    speed_limit: Floats | None
    given: GivenPolyline | None = None


@dataclass(frozen=True, slots=True)
class PathBatch:
    """M candidates on even stations, station-major and padded with their last point.

    Attributes:
        names: (M,) of the candidates.
        x, y: (N, M) positions [m].
        count: (M,) stations of each candidate.
        speed_limit: (N, M) [m/s], inf where there is none; None if no candidate has any.
        given: (M,) the polylines, None for those whose stations are what was given; empty if all
            are.
    """

    names: tuple[str, ...]
    x: Floats
    y: Floats
    count: Ints
    speed_limit: Floats | None
    given: tuple[GivenPolyline | None, ...] = ()

    def only(self, usable: Ints) -> PathBatch:
        """Some of the candidates, by their indices (m,)."""
        x, y = (np.ascontiguousarray(a[:, usable]) for a in (self.x, self.y))
        limit = self.speed_limit
        if limit is not None:
            limit = np.ascontiguousarray(limit[:, usable])
        names = tuple(self.names[j] for j in usable)
        given = tuple(self.given[j] for j in usable) if self.given else ()
        return PathBatch(names, x, y, self.count[usable], limit, given)

    def given_points(self, j: int) -> Floats:
        """(n, 2) points that were given for a candidate [m]."""
        given = self.given[j] if self.given else None
        if given is not None:
            return given.points
        points = np.empty((self.count[j], 2))
        points[:, 0], points[:, 1] = self.x[: len(points), j], self.y[: len(points), j]
        return points


def joined(paths: PathBatch, other: PathBatch) -> PathBatch:
    """Two batches in one, (max N, M + M'), the other's candidates last, as stations alone."""
    parts = (paths, other)
    rows = max(len(part.x) for part in parts)
    x, y = (_columns([getattr(part, name) for part in parts], rows) for name in "xy")
    limit = None
    if any(part.speed_limit is not None for part in parts):
        known = [
            np.full(part.x.shape, np.inf) if part.speed_limit is None else part.speed_limit
            for part in parts
        ]
        limit = _columns(known, rows)
    count = np.concatenate([part.count for part in parts])
    return PathBatch(paths.names + other.names, x, y, count, limit)


def _columns(arrays: list[Floats], rows: int) -> Floats:
    """Columns of all arrays, each padded with its last row."""
    out = np.empty((rows, sum(a.shape[1] for a in arrays)))
    j = 0
    for a in arrays:
        out[: len(a), j : j + a.shape[1]] = a
        out[len(a) :, j : j + a.shape[1]] = a[-1]
        j += a.shape[1]
    return out


def resample(
    path: CandidatePath | EvenPath, spacing: float, max_deviation: float = np.inf
) -> EvenPath:
    """Even stations along a smoothed path; a path that has them already stays as it is.

    Args:
        path: polyline.
        spacing: wanted distance between stations in the plan view [m].
        max_deviation: largest distance between line and polyline [m].

    Returns:
        N >= 3 even points [m], first and last those of the polyline, and (N,) speed limits [m/s],
        each the lowest of the polyline's limits around the station.

    Raises:
        ParameterError: too short, too long, a cusp, or driven backwards; more stations than
            ``MAX_STATIONS``; or no line without a cusp keeps within ``max_deviation``.
    """
    if isinstance(path, EvenPath):
        if path.given is not None and path.given.deviation > max_deviation:
            raise _too_far_error(path.given.points, path.points, max_deviation)
        return path
    points, limit = clean(path.points, path.speed_limit, path.yaw)
    drawn = arc(points)
    even, length = _smoothed(points, drawn, spacing)
    deviation = 0.0 if len(points) == 2 else _largest_deviation(points, even)
    if deviation > max_deviation or first_cusp(even) > 0:
        even, deviation = _followed(points, drawn, spacing, max_deviation, even)
        length = float(drawn[-1])
    limits = None
    if limit is not None:
        wanted = np.linspace(0.0, length, len(even))
        limits = _lowest_around(wanted / length, drawn / drawn[-1], limit)
    return EvenPath(path.name, even, limits, GivenPolyline(points, deviation))


def _smoothed(points: Floats, along: Floats, spacing: float) -> tuple[Floats, float]:
    """Even stations on the smooth curve that a polyline means, (N, 2), and its length [m].

    Noise is averaged, which makes the polyline shorter.

    Args:
        points: (n, 2) of the polyline; along: (n,) arc of them [m].
        spacing: of stations [m].
    """
    points, along, stray = without_noise(points, along)
    length = float(along[-1])
    # A length that is a whole number of spacings but for rounding gets no station more.
    count = max(int(np.ceil(length / spacing - 1e-6)) + 1, _FEWEST)
    if count > MAX_STATIONS:
        raise ParameterError(
            "points", f"a path of at most {MAX_STATIONS} stations, got {length:.0f} m"
        )
    if len(points) == 2:
        wanted = np.linspace(0.0, length, count)
        return points[0] + (wanted / length)[:, None] * (points[1] - points[0]), length
    return smooth(points, along, count, stray), length


def _followed(
    points: Floats, along: Floats, spacing: float, max_deviation: float, averaged: Floats
) -> tuple[Floats, float]:
    """Even stations that keep close to all points, and their distance from them [m].

    Args:
        points: (n, 2) of the polyline; along: (n,) arc of them [m].
        spacing: of stations; max_deviation: between line and polyline [m].
        averaged: the line that is too far from them, or turns round.

    Raises:
        ParameterError: no such line can be driven and is close enough.
    """
    closest, smallest = None, np.inf
    for even in (averaged, *_lines_through(points, along, spacing, _ROUNDED * max_deviation)):
        if first_cusp(even) > 0:
            continue
        deviation = _largest_deviation(points, even)
        if deviation <= max_deviation:
            return even, deviation
        if deviation < smallest:
            closest, smallest = even, deviation
    if closest is not None:
        raise _too_far_error(points, closest, max_deviation)
    x, y = averaged[first_cusp(averaged)]
    expected = f"a path without cusps: it turns round at ({x:.2f}, {y:.2f}); split it there"
    raise ParameterError(f"points[{_nearest_to(x, y, points)}]", expected)


def _lines_through(
    points: Floats, along: Floats, spacing: float, max_cut: float
) -> Iterator[Floats]:
    """Lines through the points of a polyline: with rounded corners, first with few stations.

    At last, for noise in which none of these can be driven, the curve that the noise leaves.
    """
    for finer in (1, 2, 4):
        yield rounded(points, spacing / finer, max_cut, MAX_STATIONS)
    count = max(int(np.ceil(along[-1] / spacing - 1e-6)) + 1, _FEWEST)
    yield smooth(points, along, count, min(noise(points), STRAY))


def _largest_deviation(given: Floats, even: Floats) -> float:
    """Largest distance between a polyline and the line of stations [m]."""
    distance = np.zeros(len(even))
    deviation_along(given, even, distance)
    return float(distance.max())


def _too_far_error(given: Floats, even: Floats, max_deviation: float) -> ParameterError:
    distance = np.zeros(len(even))
    deviation_along(given, even, distance)
    (x, y), deviation = even[np.argmax(distance)], float(distance.max())
    return ParameterError(
        f"points[{_nearest_to(x, y, given)}]",
        f"points that can be followed within {max_deviation:.3g} m (limits.max_path_deviation): at "
        f"({x:.2f}, {y:.2f}) the closest line that can be driven is {deviation:.2f} m off",
    )


def _nearest_to(x: float, y: float, points: Floats) -> int:
    return int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y)))


def batch(
    paths: Sequence[CandidatePath | EvenPath], spacing: float, max_deviation: float = np.inf
) -> PathBatch:
    """M paths on even stations, side by side, (N, M); see :func:`resample`."""
    return side_by_side([resample(path, spacing, max_deviation) for path in paths])


def side_by_side(paths: Sequence[EvenPath]) -> PathBatch:
    """Paths of different lengths as one batch."""
    count = np.array([len(path.points) for path in paths], np.int64)
    shape = (int(count.max()), len(paths))
    x, y = np.empty(shape), np.empty(shape)
    limits = None
    if any(path.speed_limit is not None for path in paths):
        limits = np.full(shape, np.inf)
    for j, (path, n) in enumerate(zip(paths, count, strict=True)):
        x[:n, j], y[:n, j] = path.points.T
        x[n:, j], y[n:, j] = path.points[-1]
        if limits is not None and path.speed_limit is not None:
            limits[:n, j] = path.speed_limit
    given = tuple(path.given for path in paths)
    return PathBatch(tuple(path.name for path in paths), x, y, count, limits, given)


def _lowest_around(wanted: Floats, along: Floats, limit: Floats) -> Floats:
    """The lowest limit between the neighbours of each station, (N,).

    A limit holds from its point to the next and from the one before; a plan that is linear in v²
    between two stations then keeps what holds anywhere between them.
    """
    piece = np.append(np.minimum(limit[1:], limit[:-1]), np.inf)
    last = len(along) - 2
    before = np.concatenate((wanted[:1], wanted[:-1]))
    after = np.concatenate((wanted[1:], wanted[-1:]))
    first = np.clip(np.searchsorted(along, before, side="right") - 1, 0, last)
    end = np.clip(np.searchsorted(along, after, side="left"), first + 1, last + 1)
    lowest: Floats = np.minimum.reduceat(piece, np.stack((first, end), axis=1).ravel())[::2]
    return lowest


def behind_the_front(clear: float | Floats, model: Model) -> Floats:
    """Station up to which the reference point may come: the vehicle's front stays on the free way.

    Args:
        clear: station up to which the way is known free, any shape; below 0 nothing is [m].
        model: with the front of its vehicle, ahead of the reference point.
    """
    free = np.asarray(clear, np.float64)
    reach: Floats = np.maximum(free - model.front, np.minimum(free, 0.0))
    return reach
