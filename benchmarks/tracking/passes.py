"""Bodies on planned lines, placed by kinematics that share nothing with the planner.

The rear axle of an Ackermann vehicle is integrated along the line; a body is a rectangle whose
outline is sampled, and obstacles are the squares of high cells.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from slopewise.models.arrays import Bools, Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model

_SAMPLE = 0.02  # between samples of a body [m]: a fifth of the cells of the maps here
_STEP = 0.05  # between poses on a line [m]: half a cell


def steered(model: Model) -> Model:
    """The same vehicle with steered front wheels."""
    return replace(model, vehicle=replace(model.vehicle, drive="ackermann"))


class Poses(NamedTuple):
    """Middle of the wheelbase [m] and heading [rad] along a line, (n,) each."""

    x: Floats
    y: Floats
    heading: Floats


def poses_on(x: Floats, y: Floats, model: Model) -> Poses:
    """Poses of a vehicle whose mid-wheelbase follows (N,) stations exactly; they begin straight.

    With steered front wheels the rear axle does not slip sideways.
    """
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    line = CubicSpline(arc, np.column_stack([x, y]))
    at = np.arange(0.0, arc[-1], _STEP)
    points, tangents = line(at), line(at, 1)
    heading = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))
    if model.vehicle.drive == "ackermann":
        rod = 0.5 * model.vehicle.wheelbase

        def rates(s: float, rear: Floats) -> Floats:
            ahead = (line(s) - rear) / rod
            return np.asarray(ahead * float(ahead @ line(s, 1)))

        first = points[0] - rod * np.array([np.cos(heading[0]), np.sin(heading[0])])
        rear = solve_ivp(rates, (0.0, at[-1]), first, t_eval=at, rtol=1e-7, atol=1e-9).y.T
        heading = np.arctan2(*(points - rear).T[::-1])
    return Poses(points[:, 0], points[:, 1], heading)


def strikes(
    poses: Poses,
    model: Model,
    ground: ElevationMap,
    errors: Floats | None = None,
    inset: float = 0.0,
) -> Bools:
    """(D,) draws in which the body touches a cell higher than its clearance along the poses.

    ``errors`` are (D, 2), distance of the body to the left [m] and turn [rad], one of 0 by default;
    up to a depth of ``inset`` [m] there is no contact.
    """
    shape = model.vehicle.shape
    front, rear, half = shape.front - inset, shape.rear - inset, 0.5 * shape.width - inset
    along = np.linspace(-rear, front, int((rear + front) / _SAMPLE))
    across = np.linspace(-half, half, int(2.0 * half / _SAMPLE))
    sides, ends = np.ones_like(along), np.ones_like(across)
    u = np.concatenate([along, along, front * ends, -rear * ends])
    v = np.concatenate([across[0] * sides, across[-1] * sides, across, across])
    high = ground.elevation > shape.clearance
    errors = np.zeros((1, 2)) if errors is None else errors
    return np.array([_is_marked(high, ground, *_moved(poses, e, u, v)).any() for e in errors])


def wheels_beyond(poses: Poses, model: Model, ground: ElevationMap, errors: Floats) -> Bools:
    """(D,) draws in which the middle of a wheel comes over a cell below the ground; as above."""
    half_length, half_width = 0.5 * model.vehicle.wheelbase, 0.5 * model.vehicle.track_width
    u = half_length * np.array([1.0, 1.0, -1.0, -1.0])
    v = half_width * np.array([1.0, -1.0, 1.0, -1.0])
    low = ground.elevation < -model.vehicle.shape.max_step
    return np.array([_is_marked(low, ground, *_moved(poses, e, u, v)).any() for e in errors])


def _moved(poses: Poses, error: Floats, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Points of a body with errors, (n, points) each [m]."""
    offset, turn = error
    normal_x, normal_y = -np.sin(poses.heading), np.cos(poses.heading)
    c, s = np.cos(poses.heading + turn)[:, None], np.sin(poses.heading + turn)[:, None]
    x = (poses.x + offset * normal_x)[:, None] + c * u - s * v
    return x, (poses.y + offset * normal_y)[:, None] + s * u + c * v


def _is_marked(cells: Bools, ground: ElevationMap, x: Floats, y: Floats) -> Bools:
    column = np.rint((x - ground.origin[0]) / ground.resolution).astype(int)
    row = np.rint((y - ground.origin[1]) / ground.resolution).astype(int)
    rows, columns = cells.shape
    return np.asarray(cells[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)])
