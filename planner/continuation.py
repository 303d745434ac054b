"""Where the vehicle is on its candidates, and how a path goes on from one cycle to the next.

Candidates are cut at the vehicle. The path that is being driven keeps its stations, so that the
plan of the last cycle is still one of this cycle's profiles, exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.compiled import Floats, Ints
from planner.path import PathBatch
from planner.plan import SpeedPlan

_HERE = 0.02
"""A path that begins this close to the vehicle begins at it [m]."""

_SEARCH = 15.0
"""The vehicle is looked for on this much of a path: it may cross itself later [m]."""

STEEP = 1.1
"""No path is longer than this times its length in the plan view, on ground that is driven on."""

_FEWEST = 3


@dataclass(frozen=True, slots=True)
class Place:
    """The vehicle on M polylines.

    Attributes:
        segment: (M,) index of the station behind it, 0 where it is before the first one.
        x, y: (M,) nearest point of the path [m].
        along: (M,) distance from the first station in the plan view, < 0 before it [m].
        beside: (M,) distance to the path, sideways [m].
        turned: (M,) angle between heading and path [rad].
    """

    segment: Ints
    x: Floats
    y: Floats
    along: Floats
    beside: Floats
    turned: Floats


def locate(x: Floats, y: Floats, count: Ints, at: tuple[float, float], heading: float) -> Place:
    """Find the vehicle on paths.

    Args:
        x, y: (N, M) stations [m]; count: (M,) of each path.
        at: position of the vehicle [m]; heading: [rad].
    """
    lanes = np.arange(x.shape[1])
    dx, dy = np.diff(x, axis=0), np.diff(y, axis=0)
    length = np.hypot(dx, dy)
    begins = np.vstack((np.zeros((1, x.shape[1])), np.cumsum(length, axis=0)[:-1]))
    squared = np.maximum(length * length, 1e-18)
    share = ((at[0] - x[:-1]) * dx + (at[1] - y[:-1]) * dy) / squared
    inside = np.clip(share, 0.0, 1.0)
    off = np.hypot(x[:-1] + inside * dx - at[0], y[:-1] + inside * dy - at[1])
    possible = (np.arange(len(off))[:, None] < count - 1) & (begins <= _SEARCH)
    segment: Ints = np.argmin(np.where(possible, off, np.inf), axis=0).astype(np.int64)
    u, own = share[segment, lanes], inside[segment, lanes]
    tangent_x, tangent_y = dx[segment, lanes], dy[segment, lanes]
    step = np.maximum(length[segment, lanes], 1e-9)
    first = (segment == 0) & (u < 0.0)
    along = begins[segment, lanes] + np.where(first, u, own) * step
    offset = (at[0] - x[segment, lanes]) * tangent_y - (at[1] - y[segment, lanes]) * tangent_x
    beyond = np.maximum(u - 1.0, 0.0) * step
    beside = np.hypot(offset / step, beyond)
    direction = np.arctan2(tangent_y, tangent_x) - heading
    return Place(
        segment,
        x[segment, lanes] + own * tangent_x,
        y[segment, lanes] + own * tangent_y,
        along,
        beside,
        np.abs(np.angle(np.exp(1j * direction))),
    )


def cut(paths: PathBatch, place: Place, at: tuple[float, float]) -> tuple[PathBatch, Floats]:
    """Candidates from the vehicle on.

    Args:
        paths: as they came. place: the vehicle on them. at: its position [m].

    Returns:
        The candidates, each beginning at the vehicle's place on it (at the vehicle itself where the
        path begins ahead of it); and (M,) what of each is left behind, at most [m].
    """
    if np.all(np.abs(place.along) <= _HERE):
        return paths, np.zeros(len(paths.names))
    lanes = np.arange(len(paths.names))
    ahead = place.along < 0.0
    start_x, start_y = np.where(ahead, at[0], place.x), np.where(ahead, at[1], place.y)
    kept = np.where(ahead, 0, place.segment + 1)
    # A first step that is too short would have no direction.
    spacing = np.hypot(paths.x[1] - paths.x[0], paths.y[1] - paths.y[0])
    near = np.hypot(paths.x[kept, lanes] - start_x, paths.y[kept, lanes] - start_y) < 0.3 * spacing
    kept = np.clip(kept + near, 0, np.maximum(paths.count - _FEWEST + 1, 0))
    count = paths.count - kept + 1
    rows = np.minimum(kept + np.arange(int(count.max()) - 1)[:, None], paths.count - 1)
    limit = paths.speed_limit
    if limit is not None:
        first_limit = limit[np.maximum(kept - 1, 0), lanes]
        limit = np.vstack((first_limit, np.take_along_axis(limit, rows, axis=0)))
    x = np.vstack((start_x, np.take_along_axis(paths.x, rows, axis=0)))
    y = np.vstack((start_y, np.take_along_axis(paths.y, rows, axis=0)))
    left = np.where(place.along > 0.0, place.along * STEEP, place.along)
    return PathBatch(paths.names, x, y, count, limit), left


@dataclass(frozen=True, slots=True)
class Driven:
    """The plan that is being driven, on its own stations.

    Attributes:
        plan: as it was emitted.
        speed_limit: (N,) limits of the path itself [m/s], None if it has none.
    """

    plan: SpeedPlan
    speed_limit: Floats | None

    def locate(self, at: tuple[float, float], heading: float) -> Place:
        """The vehicle on the plan's path."""
        x, y = self.plan.x[:, None], self.plan.y[:, None]
        return locate(x, y, np.array([len(x)]), at, heading)

    def _share(self, place: Place) -> float:
        """How much of its segment the vehicle has driven."""
        x, y, i = self.plan.x, self.plan.y, int(place.segment[0])
        step = np.hypot(x[i + 1] - x[i], y[i + 1] - y[i])
        gone = np.hypot(place.x[0] - x[i], place.y[0] - y[i])
        return min(float(gone / max(step, 1e-9)), 1.0)

    def speed_at(self, place: Place) -> tuple[float, float]:
        """Speed [m/s] and acceleration [m/s²] of the plan where the vehicle is."""
        plan, i, u = self.plan, int(place.segment[0]), self._share(place)
        speed_sq = (1.0 - u) * plan.speed[i] ** 2 + u * plan.speed[i + 1] ** 2
        return float(np.sqrt(speed_sq)), float(plan.accel[i])

    def station_at(self, place: Place) -> float:
        """Station of the vehicle on the plan [m]."""
        station, i = self.plan.station, int(place.segment[0])
        return float(station[i] + self._share(place) * (station[i + 1] - station[i]))

    def agrees(self, x: Floats, y: Floats, tolerance: float) -> bool:
        """Does a path run along this one, as far as both go?

        Args:
            x, y: (n,) stations of the other path [m].
            tolerance: [m].
        """
        own_x, own_y = self.plan.x, self.plan.y
        dx, dy = np.diff(own_x), np.diff(own_y)
        squared = np.maximum(dx * dx + dy * dy, 1e-18)
        share = ((x[:, None] - own_x[:-1]) * dx + (y[:, None] - own_y[:-1]) * dy) / squared
        inside = np.clip(share, 0.0, 1.0)
        off = np.hypot(own_x[:-1] + inside * dx - x[:, None], own_y[:-1] + inside * dy - y[:, None])
        nearest = np.argmin(off, axis=1)
        rows = np.arange(len(x))
        # What lies before or beyond this path says nothing.
        before = (nearest == 0) & (share[rows, 0] < 0.0)
        beyond = (nearest == len(dx) - 1) & (share[rows, -1] > 1.0)
        return bool(np.all((off[rows, nearest] <= tolerance) | before | beyond))

    def rest(self, place: Place) -> tuple[PathBatch, int]:
        """The path from just behind the vehicle, and how many of its stations are left out."""
        behind = max(int(place.segment[0]) - 1, 0)
        limit = None if self.speed_limit is None else self.speed_limit[behind:]
        return _alone(self.plan, self.plan.x[behind:], self.plan.y[behind:], limit), behind

    def going_on(
        self, place: Place, x: Floats, y: Floats, limit: Floats | None
    ) -> tuple[PathBatch, int]:
        """As :meth:`rest`, with the stations with which the path goes on now, and its limits.

        Args:
            place: the vehicle on this path.
            x, y: (n,) stations of the path as it is offered [m]; limit: (n,) [m/s].
        """
        own_x, own_y = self.plan.x, self.plan.y
        step = float(np.hypot(own_x[-1] - own_x[-2], own_y[-1] - own_y[-2]))
        direction = (own_x[-1] - own_x[-2]) / step, (own_y[-1] - own_y[-2]) / step
        off = np.hypot(x - own_x[-1], y - own_y[-1])
        further = (x - own_x[-1]) * direction[0] + (y - own_y[-1]) * direction[1]
        begin = int(np.argmin(off))
        while begin < len(x) and further[begin] < 0.5 * step:
            begin += 1
        path, behind = self.rest(place)
        limits = None
        if limit is not None or path.speed_limit is not None:
            offered = np.full(len(x), np.inf) if limit is None else limit
            near = np.argmin(np.hypot(x[:, None] - path.x[:, 0], y[:, None] - path.y[:, 0]), axis=0)
            own = offered[near]
            if path.speed_limit is not None:
                own = np.minimum(own, path.speed_limit[:, 0])
            limits = np.concatenate((own, offered[begin:]))
        return (
            _alone(
                self.plan,
                np.concatenate((path.x[:, 0], x[begin:])),
                np.concatenate((path.y[:, 0], y[begin:])),
                limits,
            ),
            behind,
        )


def _alone(plan: SpeedPlan, x: Floats, y: Floats, limit: Floats | None) -> PathBatch:
    """One path as a batch."""
    column = None if limit is None else np.ascontiguousarray(limit[:, None])
    count = np.array([len(x)], np.int64)
    return PathBatch(
        (plan.candidate,), np.ascontiguousarray(x[:, None]), np.ascontiguousarray(y[:, None]),
        count, column,
    )  # fmt: skip


def only(paths: PathBatch, place: Place, usable: Ints) -> tuple[PathBatch, Place]:
    """Some of the candidates, and the vehicle on them."""
    limit = None if paths.speed_limit is None else paths.speed_limit[:, usable]
    names = tuple(paths.names[j] for j in usable)
    x, y = (np.ascontiguousarray(a[:, usable]) for a in (paths.x, paths.y))
    fewer = PathBatch(names, x, y, paths.count[usable], limit)
    values = (getattr(place, name)[usable] for name in Place.__dataclass_fields__)
    return fewer, Place(*values)
