"""Table of `slopewise terrain`: one row per stretch, per change and per excluded part."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.terrain.agreement import ALPHA
from slopewise.models.terrain.description import GroundChange
from slopewise.models.terrain.monitor import DescribedStretch
from slopewise.services.io.table import write_csv

_MEASURED = ("samples", "speed", "speed_difference", "yaw_rate", "onset_current")
_ESTIMATED = ("motion_resistance", "lateral_resistance", "slip_track")
_TEXT = ("run", "phase", "hardness", "grip", "agrees_with", "terrain", "rules", "note")
COLUMNS = (
    "run",
    "t",
    "t_end",
    "phase",
    *_MEASURED,
    *(f"{name}{end}" for name in _ESTIMATED for end in ("", "_std")),
    "turning_thrust",
    "turning_thrust_std",
    "hardness",
    "grip",
    "agrees_with",
    "terrain",
    "probability",
    "rules",
    "centre_left",
    "centre_right",
    "change",
    "note",
)


def write_terrain_table(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Write rows of :func:`event_row` and :func:`excluded_row`, all or nothing."""
    columns = {
        name: [str(row.get(name, "")) for row in rows]
        if name in _TEXT
        else np.array([row.get(name, np.nan) for row in rows], np.float64)
        for name in COLUMNS
    }
    write_csv(columns, path)


def event_row(
    run: str,
    event: DescribedStretch | GroundChange,
    centres: tuple[float, float] = (np.nan, np.nan),
) -> dict[str, Any]:
    """A row of the table; parameters are the estimates when the stretch ends.

    ``centres`` are the centres of rotation of either side [m], NaN where unknown.
    """
    if isinstance(event, GroundChange):
        again = ", again within ten seconds" if event.again else ""
        return {
            "run": run,
            "t": event.time,
            "t_end": event.time,
            "phase": "change",
            "change": event.strength,
            "note": f"the ground changed from {event.before} to {event.now}{again}",
        }
    o = event.observation
    row = {
        "run": run,
        "t": o.begin,
        "t_end": o.end,
        "phase": o.phase.value,
        **{name: getattr(o, name) for name in _MEASURED},
        "hardness": event.description.hardness,
        "grip": event.description.grip,
        "agrees_with": " ".join(event.agrees_with),
        "terrain": event.name,
        "probability": 1.0 - ALPHA if event.name else np.nan,
        "rules": event.rules.name,
        "note": _note(event),
        "centre_left": centres[0],
        "centre_right": centres[1],
        "turning_thrust": o.turning.value,
        "turning_thrust_std": o.turning.std,
    }
    for name in _ESTIMATED:
        estimate = getattr(o.known, name)
        row[name], row[f"{name}_std"] = estimate.value, estimate.std
    return row


def _note(event: DescribedStretch) -> str:
    estimates = event.observation.measured
    notes = [estimates.motion_resistance.note, estimates.lateral_resistance.note]
    if event.is_stuck:
        notes.append("wheels spin: nothing is learned")
    return "; ".join(note for note in notes if note)


def excluded_row(run: str, time: Sequence[float] | Floats, stretch: Suspect) -> dict[str, Any]:
    """A row for an excluded stretch; ``time``: (n,) of the whole log [s]."""
    last = min(stretch.stop, len(time)) - 1
    return {
        "run": run,
        "t": float(time[stretch.start]),
        "t_end": float(time[last]),
        "phase": "excluded",
        "samples": stretch.stop - stretch.start,
        "note": stretch.reason,
    }
