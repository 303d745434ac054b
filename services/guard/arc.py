"""The arc that a command leads along over the map, and what the ground is like on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.surface_names import resolve_class
from slopewise.services.guard.ground import GuardGround
from slopewise.services.guard.model_reader import GuardModel, stands_for

_SAMPLES = 48
_STEP = 0.05  # [m] between samples at least
_STRAIGHT = 1e-6  # [1/m]


class PlanarPose(NamedTuple):
    """Where the vehicle is: middle of the wheelbase [m], heading [rad]."""

    x: float
    y: float
    heading: float


class ArcAhead(NamedTuple):
    """S samples ahead; arrays are (S,) unless said.

    Attributes:
        step: between samples [m]. curvature: left positive, along the motion [1/m].
        grade: uphill positive along the motion; roll: left side up [rad]. bend: change of the
            grade along the arc [1/m]. x, y, yaw: of the middle of the wheelbase.
        surface: (4, S) under each wheel, −1 where it may be any. kinds: which there are.
        ends: first sample that must not be reached, S if none.
        why: in words what is there.
    """

    step: float
    curvature: float
    grade: Floats
    roll: Floats
    bend: Floats
    x: Floats
    y: Floats
    yaw: Floats
    surface: Ints
    kinds: list[int]
    ends: int
    why: str


def arc_ahead(
    model: GuardModel,
    rows: Floats,
    ground: GuardGround,
    pose: PlanarPose,
    curvature: float,
    *,
    forward: bool,
    length: float,
) -> ArcAhead:
    """Look along an arc.

    Args:
        model, rows: vehicle, and its surfaces as rows. ground: map. pose: of the vehicle.
        curvature: of the arc, left of the vehicle positive [1/m]. forward: or backwards.
        length: how far is looked [m].
    """
    step = max(length / _SAMPLES, _STEP)
    s = step * np.arange(int(np.ceil(length / step)) + 1)
    sign = 1.0 if forward else -1.0
    # Backwards the arc is the same; the vehicle turns the other way around.
    turned = pose.heading + sign * curvature * s
    if abs(curvature) > _STRAIGHT:
        x = pose.x + (np.sin(turned) - np.sin(pose.heading)) / curvature
        y = pose.y - (np.cos(turned) - np.cos(pose.heading)) / curvature
    else:
        x, y = (
            pose.x + sign * s * np.cos(pose.heading),
            pose.y + sign * s * np.sin(pose.heading),
        )
    yaw: Floats = np.asarray(turned if forward else turned + np.pi, np.float64)
    cos, sin = np.cos(yaw), np.sin(yaw)
    half, aside = 0.5 * model.wheelbase, 0.5 * model.track
    lead, trail = (model.front, model.rear) if forward else (model.rear, model.front)
    ahead = np.array([half, half, -half, -half, lead, lead, lead])[:, None]
    left = np.array([aside, -aside, aside, -aside, 0.5 * model.width, 0.0, -0.5 * model.width])
    px, py = x + ahead * cos - left[:, None] * sin, y + ahead * sin + left[:, None] * cos
    z = ground.heights(px, py)
    known = np.isfinite(z)
    whole = bool(known.all())
    if not whole:
        known |= _below(model, pose, (px, py), (lead, trail), float(yaw[0]))
    fl, fr, rl, rr = z[:4]
    grade = np.arctan2(0.5 * (fl + fr - rl - rr), model.wheelbase)
    roll = np.arctan2(0.5 * (fl - fr + rl - rr), model.track)
    if not whole:
        grade, roll = _filled(grade), _filled(roll)
    named = surface_rows(model, ground)
    surface = named[ground.surfaces(px[:4], py[:4])]
    kinds = sorted(set(surface.ravel().tolist())) if len(named) > 1 else named.tolist()
    if -1 in kinds:
        kinds = list(range(len(model.surfaces)))
    if len(model.surfaces) > 1:
        kinds = sorted({*kinds, *(k for k, of in enumerate(stands_for(model)) if of in kinds)})
    # What the body meets stands above the plane of the wheels.
    plane = 0.25 * (fl + fr + rl + rr) + np.tan(grade) * lead
    side = np.tan(roll) * left[4:, None]
    struck = np.any(z[4:] - (plane + side) > 2.0 * model.step, axis=0)
    ends, why = _end(rows, (known, grade, roll, struck, surface))
    reach = max(round(half / step), 1)
    bend = np.zeros_like(grade)
    if len(s) > 2 * reach:
        bend[reach:-reach] = (grade[2 * reach :] - grade[: -2 * reach]) / (2 * reach * step)
    return ArcAhead(step, sign * curvature, grade, roll, bend, x, y, yaw, surface, kinds, ends, why)


def surface_rows(model: GuardModel, ground: GuardGround) -> Ints:
    """For each surface that the map names, the row of the model; -1 where it knows none."""
    rows, tables = list(model.surfaces), {n: s for n, s in model.surfaces.items() if n}
    surfaces = [resolve_class(tables, name) for name in ground.names]
    return np.array([-1 if surface is None else rows.index(surface) for surface in surfaces])


def _below(
    model: GuardModel,
    pose: PlanarPose,
    points: tuple[Floats, Floats],
    ends: tuple[float, float],
    yaw: float,
) -> Bools:
    """Points under the vehicle as it stands: nobody has to see them, it is there already."""
    east, north = points[0] - pose.x, points[1] - pose.y
    along = east * np.cos(yaw) + north * np.sin(yaw)
    across = north * np.cos(yaw) - east * np.sin(yaw)
    inside: Bools = (along < ends[0]) & (along > -ends[1]) & (np.abs(across) <= 0.5 * model.width)
    return inside


def _filled(values: Floats) -> Floats:
    """Unknown slopes at the beginning are those of the first ground that is known."""
    known = np.isfinite(values)
    if known.all():
        return values
    first = values[int(np.argmax(known))] if known.any() else 0.0
    return np.where(known, values, first)


def _end(rows: Floats, seen: tuple[Bools, Floats, Floats, Bools, Ints]) -> tuple[int, str]:
    known, grade, roll, struck, surface = seen
    under = rows[surface[:, -1]] if len(rows) == 2 else rows[surface.T]
    low, high = under[..., 10].max(axis=-1), under[..., 11].min(axis=-1)
    steep = np.asarray((grade < low) | (grade > high), np.bool_)
    steep |= (roll < under[..., 12].max(axis=-1)) | (roll > under[..., 13].min(axis=-1))
    blind = np.asarray(~known.all(axis=0), np.bool_)
    bars = steep | blind | struck
    if not bars.any():
        return len(grade), ""
    k = int(np.argmax(bars))
    if blind[k]:
        return k, "ground is unknown"
    return k, (
        "ground is steeper than the brakes were learned on" if steep[k] else "an obstacle stands"
    )
