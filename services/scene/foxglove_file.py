"""Plans as MCAP in Foxglove's own schemas: /map, /candidates, /tf, /vehicle, /plan."""

from __future__ import annotations

import io
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.models.vehicle import Vehicle
from slopewise.planner.plan import SpeedPlan
from slopewise.services.io.files import write_atomic
from slopewise.services.io.units import finite
from slopewise.services.scene import drawing

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


def write_mcap(
    path: Path,
    ground: ElevationMap,
    plans: Sequence[SpeedPlan],
    vehicle: Vehicle,
    begin: int | None = None,
) -> None:
    """Write ground, all candidates, and the drive of the best plan, all or nothing.

    The drive begins now, or at `begin` [ns since 1970]; the vehicle is a box of its size.
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
            driven = drawing.drive(plan)
            schema = _schema(list(driven.series))
            numbers = foxglove.Channel("/plan", schema=schema, context=context)
            _drive(driven, plan.candidate, begin, transforms, numbers)
    write_atomic(path, buffer.getvalue())


def _ground(ground: ElevationMap, begin: int) -> Any:
    mesh = drawing.surface(ground)
    triangles = messages.TriangleListPrimitive(
        points=[messages.Point3(x=x, y=y, z=z) for x, y, z in mesh.vertices.tolist()],
        colors=[_colour(rgb) for rgb in mesh.colours.tolist()],
        indices=mesh.triangles.ravel().tolist(),
    )
    facts = {"resolution [m]": f"{ground.resolution:g}", "drawn every": f"{mesh.step} cells"}
    return messages.SceneUpdate(
        entities=[_entity(MAP_FRAME, "ground", begin, facts, triangles=[triangles])]
    )


def _candidates(plans: Sequence[SpeedPlan], begin: int) -> Any:
    fastest = drawing.fastest_of(plans)
    entities = []
    for plan in plans:
        points, colours = drawing.ribbon(plan, fastest)
        primitive = messages.LinePrimitive(
            type=messages.LinePrimitiveLineType.LineStrip,
            thickness=_THICK,
            scale_invariant=True,
            points=[messages.Point3(x=x, y=y, z=z) for x, y, z in points.tolist()],
            colors=[_colour(rgb) for rgb in colours.tolist()],
        )
        facts = {
            "status": plan.status.value,
            "reason": plan.reason,
            "travel time [s]": f"{plan.travel_time:.2f}",
            "progress [m]": f"{plan.progress:.2f}",
        }
        entities.append(_entity(MAP_FRAME, plan.candidate, begin, facts, lines=[primitive]))
    return messages.SceneUpdate(entities=entities)


def _vehicle(vehicle: Vehicle, begin: int) -> Any:
    (length, width, height), middle = drawing.box_of(vehicle)
    cube = messages.CubePrimitive(
        pose=messages.Pose(
            position=messages.Vector3(x=0.0, y=0.0, z=middle),
            orientation=messages.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
        ),
        size=messages.Vector3(x=length, y=width, z=height),
        color=_colour((0, 114, 178), 0.6),
    )
    facts = {"wheelbase [m]": f"{vehicle.wheelbase:g}"}
    return messages.SceneUpdate(
        entities=[_entity(VEHICLE_FRAME, "vehicle", begin, facts, locked=True, cubes=[cube])]
    )


def _drive(
    driven: drawing.DrivenPlan, name: str, begin: int, transforms: Any, numbers: Any
) -> None:
    for k, moment in enumerate(driven.time.tolist()):
        at = begin + round(moment * _NANO)
        x, y, z = driven.position[k].tolist()
        turn = dict(zip("xyzw", driven.quaternion[k].tolist(), strict=True))
        transforms.log(
            messages.FrameTransform(
                timestamp=_stamp(at),
                parent_frame_id=MAP_FRAME,
                child_frame_id=VEHICLE_FRAME,
                translation=messages.Vector3(x=x, y=y, z=z),
                rotation=messages.Quaternion(**turn),
            ),
            log_time=at,
        )
        row = {key: finite(values[k]) for key, values in driven.series.items()}
        numbers.log({"candidate": name, "time_s": moment, **row}, log_time=at)


def _schema(names: list[str]) -> dict[str, Any]:
    """JSON schema of /plan; a number that is not finite is null."""
    return {
        "type": "object",
        "title": "slopewise.plan",
        "properties": {
            "candidate": {"type": "string"},
            "time_s": {"type": "number"},
            **{name: {"type": ["number", "null"]} for name in names},
        },
    }


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
