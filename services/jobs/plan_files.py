"""Write plans as a table, or as a scene for Foxglove."""

from __future__ import annotations

from pathlib import Path

from slopewise.services.io.plan_file import joined, write_plan_csv
from slopewise.services.jobs.plan import PlanResult

_SCENE = ".mcap"
"""Ending of a scene; other plans are CSV tables."""

ENDINGS = ".csv", _SCENE


def write_plans(result: PlanResult, path: Path) -> None:
    """Write all plans, best first, in the format of the file's ending."""
    if path.suffix.lower() == _SCENE:
        from slopewise.services.scene.foxglove_file import write_mcap

        write_mcap(path, result.elevation_map, result.plans, result.model.vehicle)
    else:
        write_plan_csv(joined(result.plans), path)
