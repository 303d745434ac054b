"""Plans as MCAP in Foxglove's own schemas: /map, /candidates, /tf, /vehicle, /plan.

The ground is a mesh, candidates are coloured by speed, the vehicle is a box, and numbers of the
driven plan are to be plotted over time.
"""

from __future__ import annotations

import io
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.models.vehicle import Vehicle
from slopewise.planner.plan import SpeedPlan
from slopewise.services.io.files import write_atomic
from slopewise.services.io.units import finite
from slopewise.services.scene.shading import shade

try:
    import foxglove
    from foxglove import messages
    from foxglove.channels import FrameTransformChannel, SceneUpdateChannel
except ImportError:
    hint = "expected foxglove-sdk to write .mcap, got none: pip install '.[viz]' in a clone"
    raise InputError("--out", "", hint) from None

MAP_FRAME = "map"
VEHICLE_FRAME = "vehicle"
_THICK = 4.0  # pixels
_NANO = 1_000_000_000  # [ns/s]

_MAX_VERTICES = 60_000
"""Ground is drawn coarser beyond that; viewers build an object for each."""

_LIFT = 0.05
"""Paths are drawn that much above the ground, or they would be in it [m]."""

_SPEEDS = ((13, 8, 135), (126, 3, 168), (204, 71, 120), (248, 149, 64), (240, 249, 33))
"""Red, green, blue of matplotlib's colour map `plasma` at 0, 1/4, 1/2, 3/4 and 1."""

NOT_DRIVEN = (110, 110, 110)
"""Grey of the path beyond the place where a plan stops."""


def write_mcap(
    path: Path,
    ground: ElevationMap,
    plans: Sequence[SpeedPlan],
    vehicle: Vehicle,
    begin: int | None = None,
) -> None:
    """Write ground, all candidates, and the drive of the best plan, all or nothing.

    The drive begins now, or at `begin` [ns since 1970].
    """
    begin = time.time_ns() if begin is None else begin
    buffer, context = io.BytesIO(), foxglove.Context()
    with foxglove.open_mcap(buffer, context=context):
        for topic, scene in {
            "/map": _ground(ground, begin),
            "/candidates": _candidates(plans, begin),
            "/vehicle": _vehicle(vehicle, begin),
        }.items():
            SceneUpdateChannel(topic, context=context).log(scene, log_time=begin)
        transforms = FrameTransformChannel("/tf", context=context)
        for plan in plans[:1]:
            series = _series(plan)
            numbers = foxglove.Channel("/plan", schema=_schema(series), context=context)
            _drive(plan, series, begin, transforms, numbers)
    write_atomic(path, buffer.getvalue())


def _ground(ground: ElevationMap, begin: int) -> Any:
    vertices, triangles, colours, step = mesh(ground)
    surface = messages.TriangleListPrimitive(
        points=_points(vertices),
        colors=[_colour(rgb) for rgb in colours.tolist()],
        indices=triangles.ravel().tolist(),
    )
    facts = {"resolution [m]": f"{ground.resolution:g}", "drawn every": f"{step} cells"}
    return messages.SceneUpdate(
        entities=[_entity(MAP_FRAME, "ground", begin, facts, triangles=[surface])]
    )


def mesh(
    ground: ElevationMap, max_vertices: int = _MAX_VERTICES
) -> tuple[Floats, NDArray[np.uint32], NDArray[np.uint8], int]:
    """Known ground as triangles; where a cell is unknown there is a hole.

    Returns vertices (n, 3) [m], triangles (m, 3) of them, counter-clockwise from above, their red,
    green and blue (n, 3), and the cells of the map between two vertices.
    """
    step = max(1, math.ceil(math.sqrt(ground.elevation.size / max_vertices)))
    heights = ground.elevation[::step, ::step]
    grey = shade(ground.elevation, ground.resolution)[::-1][::step, ::step, 0]
    rows, columns = heights.shape
    known = np.isfinite(heights)
    number = np.cumsum(known.ravel()).reshape(known.shape) - 1
    row, column = np.nonzero(known)
    cell = step * ground.resolution
    vertices = np.stack(
        [ground.origin[0] + cell * column, ground.origin[1] + cell * row, heights[known]], axis=1
    )
    i, j = (index.ravel() for index in np.indices((max(rows - 1, 0), max(columns - 1, 0))))
    triangles = []
    for corners in (((0, 0), (0, 1), (1, 1)), ((0, 0), (1, 1), (1, 0))):
        at = [(i + di, j + dj) for di, dj in corners]
        complete = np.logical_and.reduce([known[place] for place in at])
        triangles.append(np.stack([number[place][complete] for place in at], axis=1))
    colours = np.repeat(grey[known][:, None], 3, axis=1)
    return vertices, np.concatenate(triangles).astype(np.uint32), colours, step


def _candidates(plans: Sequence[SpeedPlan], begin: int) -> Any:
    fastest = max((float(plan.speed.max()) for plan in plans), default=0.0)
    entities = []
    for plan in plans:
        primitive = messages.LinePrimitive(
            type=messages.LinePrimitiveLineType.LineStrip,
            thickness=_THICK,
            scale_invariant=True,
            points=_points(np.stack([plan.x, plan.y, plan.z + _LIFT], axis=1)),
            colors=[_colour(rgb) for rgb in colours_of(plan, fastest).tolist()],
        )
        facts = {
            "status": plan.status.value,
            "reason": plan.reason,
            "travel time [s]": f"{plan.travel_time:.2f}",
            "progress [m]": f"{plan.progress:.2f}",
        }
        entities.append(_entity(MAP_FRAME, plan.candidate, begin, facts, lines=[primitive]))
    return messages.SceneUpdate(entities=entities)


def colours_of(plan: SpeedPlan, fastest: float) -> NDArray[np.uint8]:
    """(n, 3) along a plan, from dark blue at rest to yellow at ``fastest`` [m/s]."""
    share = np.clip(plan.speed / max(fastest, 1e-9), 0.0, 1.0) * (len(_SPEEDS) - 1)
    channels = [
        np.interp(share, range(len(_SPEEDS)), levels) for levels in zip(*_SPEEDS, strict=True)
    ]
    colours = np.rint(np.stack(channels, axis=1)).astype(np.uint8)
    colours[plan.station > plan.progress + 1e-9] = NOT_DRIVEN
    return colours


def _vehicle(vehicle: Vehicle, begin: int) -> Any:
    height = 2.0 * vehicle.cg_z
    cube = messages.CubePrimitive(
        pose=messages.Pose(
            position=messages.Vector3(x=0.0, y=0.0, z=0.5 * height),
            orientation=messages.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
        ),
        size=messages.Vector3(
            x=vehicle.wheelbase + 2.0 * vehicle.wheel_radius, y=vehicle.track_width, z=height
        ),
        color=_colour((0, 114, 178), 0.6),
    )
    facts = {"wheelbase [m]": f"{vehicle.wheelbase:g}"}
    return messages.SceneUpdate(
        entities=[_entity(VEHICLE_FRAME, "vehicle", begin, facts, locked=True, cubes=[cube])]
    )


def _series(plan: SpeedPlan) -> dict[str, Floats]:
    """Numbers to plot, (n,); each name says its unit, loads are shares of the level static load."""
    return {
        "speed_m_s": plan.speed,
        "speed_bound_m_s": plan.speed_bound,
        "accel_m_s2": plan.accel,
        "station_m": plan.station,
        "stop_distance_m": plan.stop_distance,
        "margin_m": plan.clear_distance - plan.station - plan.stop_distance,
        "grade_deg": np.rad2deg(plan.grade),
        "roll_deg": np.rad2deg(plan.roll),
        "rear_load": plan.rear_load,
        "side_load": plan.side_load,
    }


def attitudes(plan: SpeedPlan) -> Floats:
    """(n, 4) quaternions x, y, z, w of the vehicle at the stations."""
    heading = np.unwrap(np.arctan2(np.gradient(plan.y), np.gradient(plan.x)))
    # REP-103: pitch is nose down positive, roll is left side up positive.
    turns = np.stack([heading, -plan.grade, plan.roll], axis=1)
    return np.asarray(Rotation.from_euler("ZYX", turns).as_quat())


def _drive(
    plan: SpeedPlan, series: dict[str, Floats], begin: int, transforms: Any, numbers: Any
) -> None:
    """Log the moments at which a plan passes its stations, up to where it stops."""
    position, turns = np.stack([plan.x, plan.y, plan.z], axis=1), attitudes(plan)
    for k in np.flatnonzero(np.diff(plan.time, prepend=-np.inf) > 0.0).tolist():
        moment = float(plan.time[k])
        at = begin + round(moment * _NANO)
        x, y, z = position[k].tolist()
        transforms.log(
            messages.FrameTransform(
                timestamp=_stamp(at),
                parent_frame_id=MAP_FRAME,
                child_frame_id=VEHICLE_FRAME,
                translation=messages.Vector3(x=x, y=y, z=z),
                rotation=messages.Quaternion(**dict(zip("xyzw", turns[k].tolist(), strict=True))),
            ),
            log_time=at,
        )
        row = {name: finite(values[k]) for name, values in series.items()}
        numbers.log({"candidate": plan.candidate, "time_s": moment, **row}, log_time=at)


def _schema(series: dict[str, Floats]) -> dict[str, Any]:
    """JSON schema of /plan; a number that is not finite is null."""
    return {
        "type": "object",
        "title": "slopewise.plan",
        "properties": {
            "candidate": {"type": "string"},
            "time_s": {"type": "number"},
            **{name: {"type": ["number", "null"]} for name in series},
        },
    }


def _points(places: Floats) -> list[Any]:
    return [messages.Point3(x=x, y=y, z=z) for x, y, z in places.tolist()]


def _entity(
    frame: str, name: str, begin: int, facts: dict[str, str], *, locked: bool = False, **parts: Any
) -> Any:
    return messages.SceneEntity(
        timestamp=_stamp(begin),
        frame_id=frame,
        id=name,
        frame_locked=locked,
        metadata=[messages.KeyValuePair(key=key, value=value) for key, value in facts.items()],
        **parts,
    )


def _stamp(at: int) -> Any:
    return messages.Timestamp(sec=at // _NANO, nsec=at % _NANO)


def _colour(rgb: Sequence[int], alpha: float = 1.0) -> Any:
    red, green, blue = (channel / 255.0 for channel in rgb)
    return messages.Color(r=red, g=green, b=blue, a=alpha)
