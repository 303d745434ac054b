"""Cross-track and heading errors of a drive, from its poses and the path that it was to follow."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats, Ints

_SPACING = 0.25
"""Distance of the points that a path is drawn from [m]: a log has many samples in one place."""

_CHORD = 1.0
"""Length over which a path has one direction [m]; its curvature is that of two such chords."""

_MOVING = 0.1  # [m/s] at rest no path is followed
_FARTHEST = 3.0
"""Distance from which a vehicle is not following the path [m]: the planner knows no wider band."""

_BEHIND, _AHEAD = 6.0, 3.0
"""The foot of a pose is searched for behind and ahead of the point of the path in its sample [m]:
that is the nearest point, or the one at which the tracker aims."""


@dataclass(frozen=True, slots=True)
class TrackingSamples:
    """Errors at n samples that move along a path; arrays are (n,).

    Attributes:
        cross_track: offset from the path, to the left positive [m].
        heading: heading of the body less that of the path [rad], NaN without a yaw.
        curvature: path curvature [1/m]. speed: vehicle speed [m/s].
        session: index of the session. travelled: distance along its run [m].
        sessions: their names. omitted: samples that were too far from any path.
    """

    cross_track: Floats
    heading: Floats
    curvature: Floats
    speed: Floats
    session: Ints
    travelled: Floats
    sessions: tuple[str, ...]
    omitted: int


def tracking_samples(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice]
) -> TrackingSamples | None:
    """All samples with a pose and a path; None where the log has no such columns.

    Args:
        columns: columns of a drive log, with `x`, `y`, `path_x`, `path_y` [m], maybe `yaw` [rad].
        runs: its runs.
    """
    if not {"x", "y", "path_x", "path_y"} <= columns.keys():
        return None
    named = columns.get("session", columns["run"])
    sessions = tuple(dict.fromkeys(str(s) for s in named))
    parts: list[Floats] = []
    omitted, begin = 0, 0.0
    for run in runs:
        rows = {name: columns[name][run] for name in ("x", "y", "path_x", "path_y", "v")}
        yaw = columns["yaw"][run] if "yaw" in columns else np.full(len(rows["x"]), np.nan)
        errors = _of_run(rows, yaw)
        if errors is None:
            continue
        errors[4] += begin
        begin = float(errors[4].max(initial=begin))
        omitted += int(np.sum(np.abs(errors[0]) > _FARTHEST))
        errors = errors[:, np.abs(errors[0]) <= _FARTHEST]
        session = np.full((1, errors.shape[1]), sessions.index(str(named[run.start])), np.float64)
        parts.append(np.concatenate((errors, session)))
    if not parts:
        return None
    cross, heading, curvature, speed, travelled, session = np.concatenate(parts, axis=1)
    return TrackingSamples(
        cross, heading, curvature, speed, session.astype(np.int64), travelled, sessions, omitted
    )


def _of_run(rows: Mapping[str, Floats], yaw: Floats) -> Floats | None:
    """Errors, curvature, speed and distance (5, n) of one run; None without a path in it."""
    use = np.isfinite(sum(rows.values())) & (np.abs(rows["v"]) > _MOVING)
    rows = {name: values[use] for name, values in rows.items()}
    line, along, near = _polyline(np.column_stack([rows["path_x"], rows["path_y"]]))
    if len(line) * _SPACING <= 2.0 * _CHORD:
        return None
    points = np.column_stack([rows["x"], rows["y"]])
    cross, feet = _feet(line, along, points, near)
    # Chords of a curve lie inside it: heading and curvature are those of longer chords.
    ahead, behind = (_at(line, along, feet + side * _CHORD) for side in (1.0, -1.0))
    here = _at(line, along, feet)
    onward, before = ahead - here, here - behind
    direction = np.arctan2(*(ahead - behind).T[::-1])
    turn = np.arctan2(*onward.T[::-1]) - np.arctan2(*before.T[::-1])
    travelled = np.concatenate(([0.0], np.hypot(*np.diff(points, axis=0).T).cumsum()))
    errors: Floats = np.stack(
        [cross, _wrapped(yaw[use] - direction), _wrapped(turn) / _CHORD, rows["v"], travelled]
    )
    return errors[:, (feet > _CHORD) & (feet < along[-1] - _CHORD)]


def _polyline(points: Floats) -> tuple[Floats, Floats, Ints]:
    """Points of a path at even distances, their stations, and which one each sample is at.

    Args:
        points: (n, 2) one point of the path a sample [m].
    """
    vertices: list[Floats] = []
    near = np.empty(len(points), np.int64)
    for n, point in enumerate(points):
        if not vertices or np.hypot(*(point - vertices[-1])) >= _SPACING:
            vertices.append(point)
        near[n] = len(vertices) - 1
    line = np.array(vertices).reshape(-1, 2)
    along = np.concatenate(([0.0], np.hypot(*np.diff(line, axis=0).T).cumsum()))
    return line, along, near


def _feet(line: Floats, along: Floats, points: Floats, near: Ints) -> tuple[Floats, Floats]:
    """Signed distances from the line, and stations of the feet on it, (n,) each [m].

    A path may cross itself: each foot is searched for around the point of its sample.
    """
    step, length = np.diff(line, axis=0), np.diff(along)
    around = np.arange(-math.ceil(_BEHIND / _SPACING), math.ceil(_AHEAD / _SPACING) + 1)
    k = np.clip(near[:, None] + around, 0, len(step) - 1)
    to = points[:, None] - line[k]
    share = np.clip(np.sum(to * step[k], axis=2) / length[k] ** 2, 0.0, 1.0)
    distance = np.hypot(*np.moveaxis(to - share[..., None] * step[k], 2, 0))
    rows, best = np.arange(len(points)), np.argmin(distance, axis=1)
    k = k[rows, best]
    to = points - line[k]
    side = step[k, 0] * to[:, 1] - step[k, 1] * to[:, 0]
    feet = along[k] + share[rows, best] * length[k]
    return np.copysign(distance[rows, best], side), feet


def _at(line: Floats, along: Floats, station: Floats) -> Floats:
    return np.column_stack([np.interp(station, along, line[:, i]) for i in (0, 1)])


def _wrapped(angle: Floats) -> Floats:
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi
