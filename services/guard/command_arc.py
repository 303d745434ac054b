"""Arc that a command leads along over the map, and the ground on it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.surface_names import resolve_class
from slopewise.services.guard.guard_map import classes_at, wheel_heights
from slopewise.services.guard.guard_model import GuardModel, SurfaceTable

_SAMPLES = 48
"""Samples of an arc: on one of 5 m a sample is shorter than the cells of robots' maps [1]."""

_MIN_STEP = 0.05  # distance of samples at least, a quarter of a usual cell [m]
_STRAIGHT = 1e-6  # curvature below which an arc is straight: within 80 m it is off by 3 mm [1/m]

_OBSTACLE_STEPS = 2.0
"""Steps that a wheel may climb by which ground under the body stands out before it blocks [1]."""


class Pose2d(NamedTuple):
    """Middle of the wheelbase [m] and heading [rad] on the map."""

    x: float
    y: float
    heading: float


class CommandArc(NamedTuple):
    """S samples ahead; arrays are (S,) where no other shape is given."""

    step: float  # distance of samples [m]
    curvature: float  # along the motion, left positive [1/m]
    grade: Floats  # grade, roll: uphill positive along the motion, left side up positive [rad]
    roll: Floats
    vertical_curvature: Floats  # change of the grade along the arc [1/m]
    x: Floats  # x, y, yaw: middle of the wheelbase [m], direction of motion [rad]
    y: Floats
    yaw: Floats
    under: Ints  # (4, S) surface under each wheel as index into the model, -1 where it may be any
    possible: list[int]  # indices of all surfaces that may be under a wheel, with their states
    end: int  # first sample that must not be reached, S if all may be
    reason: str  # what is at the end, empty if all samples may be reached


def arc_ahead(
    model: GuardModel,
    table: SurfaceTable,
    ground: ElevationMap,
    pose: Pose2d,
    curvature: float,
    *,
    forward: bool,
    length: float,
) -> CommandArc:
    """Sample the ground along an arc for ``length`` [m]; ``curvature``: left positive [1/m]."""
    step = max(length / _SAMPLES, _MIN_STEP)
    station = step * np.arange(math.ceil(length / step) + 1, dtype=np.float64)
    x, y, yaw = _along(pose, curvature, station, forward=forward)
    vehicle, shape, half = model.vehicle, model.shape, 0.5 * model.vehicle.wheelbase
    lead, trail = (shape.front, shape.rear) if forward else (shape.rear, shape.front)
    sides = 0.5 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, 0.0, -1.0])
    y_body = (sides * np.array([vehicle.track_width] * 4 + [shape.width] * 3))[:, None]
    x_body = np.array([half, half, -half, -half, lead, lead, lead])[:, None]
    cos, sin = np.cos(yaw), np.sin(yaw)
    px, py = x + x_body * cos - y_body * sin, y + x_body * sin + y_body * cos
    felt = wheel_heights(ground, vehicle)
    z = np.concatenate((felt.contact(px[:4], py[:4], yaw), felt.at(px[4:], py[4:])))
    fl, fr, rl, rr = z[:4]
    grade = np.arctan2(0.5 * (fl + fr - rl - rr), vehicle.wheelbase)
    roll = np.arctan2(0.5 * (fl - fr + rl - rr), vehicle.track_width)
    known = np.isfinite(z)
    if not known.all():
        known |= _under_vehicle(model, pose, (px, py), (lead, trail), float(yaw[0]))
        grade, roll = _extended(grade), _extended(roll)
    under = map_surfaces(model, ground)[classes_at(ground, px[:4], py[:4])]
    plane = 0.25 * (fl + fr + rl + rr) + np.tan(grade) * lead + np.tan(roll) * y_body[4:]
    struck = (z[4:] - plane > _OBSTACLE_STEPS * shape.max_step).any(axis=0)
    unknown: Bools = ~np.all(known, axis=0)
    end, reason = _end(table, unknown, (grade, roll), struck, under)
    reach = max(round(half / step), 1)
    change = np.zeros_like(grade)
    if len(station) > 2 * reach:
        change[reach:-reach] = (grade[2 * reach :] - grade[: -2 * reach]) / (2 * reach * step)
    signed = curvature if forward else -curvature
    possible = _possible(model, under)
    return CommandArc(step, signed, grade, roll, change, x, y, yaw, under, possible, end, reason)


def map_surfaces(model: GuardModel, ground: ElevationMap) -> Ints:
    """Index in the model of each surface that the map names; -1 where the model lacks it."""
    names = list(model.surfaces)
    surfaces = [resolve_class(model.named, name) for name in ground.class_names]
    return np.array([-1 if surface is None else names.index(surface) for surface in surfaces])


def _along(
    pose: Pose2d, curvature: float, station: Floats, *, forward: bool
) -> tuple[Floats, Floats, Floats]:
    """x, y [m], direction of motion [rad]; in reverse the arc is the same, turned the other way."""
    sign = 1.0 if forward else -1.0
    heading = pose.heading + sign * curvature * station
    if abs(curvature) > _STRAIGHT:
        x = pose.x + (np.sin(heading) - np.sin(pose.heading)) / curvature
        y = pose.y - (np.cos(heading) - np.cos(pose.heading)) / curvature
    else:
        x = pose.x + sign * station * np.cos(pose.heading)
        y = pose.y + sign * station * np.sin(pose.heading)
    return x, y, heading if forward else heading + np.pi


def _under_vehicle(
    model: GuardModel,
    pose: Pose2d,
    points: tuple[Floats, Floats],
    ends: tuple[float, float],
    yaw: float,
) -> Bools:
    """Points under the vehicle where it stands: no sensor has to see them, it is there already."""
    east, north = points[0] - pose.x, points[1] - pose.y
    along = east * np.cos(yaw) + north * np.sin(yaw)
    across = north * np.cos(yaw) - east * np.sin(yaw)
    inside: Bools = (
        (along < ends[0]) & (along > -ends[1]) & (np.abs(across) <= 0.5 * model.shape.width)
    )
    return inside


def _extended(slope: Floats) -> Floats:
    """Slopes with unknown ones replaced by the first known one, or by level ground."""
    known = np.isfinite(slope)
    first = slope[int(np.argmax(known))] if known.any() else 0.0
    return np.where(known, slope, first)


def _possible(model: GuardModel, under: Ints) -> list[int]:
    seen = set(under.ravel().tolist())
    if -1 in seen:
        return list(range(len(model.surfaces)))
    return [k for k, of in enumerate(model.governing) if k in seen or of in seen]


def _end(
    table: SurfaceTable, unknown: Bools, slopes: tuple[Floats, Floats], struck: Bools, under: Ints
) -> tuple[int, str]:
    """First sample that must not be reached, and the reason."""
    grade, roll = slopes
    steep = (grade < table.grade_min[under].max(axis=0)) | (
        roll < table.roll_min[under].max(axis=0)
    )
    steep |= (grade > table.grade_max[under].min(axis=0)) | (
        roll > table.roll_max[under].min(axis=0)
    )
    blocked = steep | unknown | struck
    if not blocked.any():
        return len(grade), ""
    k = int(np.argmax(blocked))
    if unknown[k]:
        return k, "ground is unknown"
    return k, "ground is steeper than the brakes were learned on" if steep[
        k
    ] else "an obstacle stands"
