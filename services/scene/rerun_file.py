"""Plans as a recording of rerun: ground, candidates, the drive of the best plan, plots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.models.vehicle import Vehicle
from slopewise.planner.plan import SpeedPlan
from slopewise.services.io.files import write_atomic
from slopewise.services.scene import drawing

try:
    import rerun as rr
    import rerun.blueprint as rrb
except ImportError:
    hint = "expected rerun-sdk to write .rrd, got none: pip install '.[viz]' in a clone"
    raise InputError("--out", "", hint) from None

_TIMELINE = "plan"
_PLOTS = {
    "speed": ("speed_m_s", "speed_bound_m_s"),
    "emergency stop": ("stop_distance_m", "margin_m"),
    "loads": ("rear_load", "side_load"),
}


def write_rrd(
    path: Path, ground: ElevationMap, plans: Sequence[SpeedPlan], vehicle: Vehicle
) -> None:
    """Write ground, all candidates, and the drive of the best plan, all or nothing."""
    recording = rr.RecordingStream("slopewise")
    sink = recording.memory_recording()
    recording.send_blueprint(_blueprint())
    recording.log("map", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    mesh = drawing.surface(ground)
    # A mesh with a corner that moves from map to map would lose digits far from the origin.
    origin = mesh.vertices.mean(axis=0)
    recording.log(
        "map/ground",
        rr.Mesh3D(
            vertex_positions=(mesh.vertices - origin).astype(np.float32),
            triangle_indices=mesh.triangles,
            vertex_colors=mesh.colours,
        ),
        static=True,
    )
    _log_candidates(recording, plans, origin)
    for plan in plans[:1]:
        _log_drive(recording, drawing.drive(plan), vehicle, origin)
    recording.flush()
    write_atomic(path, sink.drain_as_bytes())


def _log_candidates(recording: Any, plans: Sequence[SpeedPlan], origin: Any) -> None:
    fastest = drawing.fastest_of(plans)
    for number, plan in enumerate(plans):
        points, colours = drawing.ribbon(plan, fastest)
        points = points - origin
        # Each piece has one colour: that of the station it begins at.
        entity = f"map/candidates/{number}"
        recording.log(
            entity,
            rr.LineStrips3D(
                np.stack([points[:-1], points[1:]], axis=1).astype(np.float32),
                colors=colours[:-1],
                radii=rr.Radius.ui_points(2.0),
            ),
            rr.AnyValues(
                candidate=plan.candidate, status=plan.status.value, reason=plan.reason or "–"
            ),
            static=True,
        )


def _log_drive(recording: Any, driven: drawing.DrivenPlan, vehicle: Vehicle, origin: Any) -> None:
    (length, width, height), middle = drawing.box_of(vehicle)
    half = [length / 2.0, width / 2.0, height / 2.0]
    box = rr.Boxes3D(half_sizes=[half], centers=[[0.0, 0.0, middle]], colors=[(0, 114, 178)])
    recording.log("map/vehicle", box, static=True)
    clock = [rr.TimeColumn(_TIMELINE, duration=driven.time)]
    recording.send_columns(
        "map/vehicle",
        clock,
        rr.Transform3D.columns(
            translation=(driven.position - origin).astype(np.float32),
            quaternion=driven.quaternion.astype(np.float32),
        ),
    )
    for name, values in driven.series.items():
        recording.send_columns(f"plan/{name}", clock, rr.Scalars.columns(scalars=values))


def _blueprint() -> Any:
    plots = [
        rrb.TimeSeriesView(name=title, contents=[f"/plan/{name}" for name in names])
        for title, names in _PLOTS.items()
    ]
    view = rrb.Spatial3DView(origin="/map", name="candidates by speed")
    return rrb.Blueprint(
        rrb.Horizontal(view, rrb.Vertical(*plots), column_shares=[3, 2]), collapse_panels=True
    )
