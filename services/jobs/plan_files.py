"""Write plans as a table, or as a scene for Foxglove."""

from __future__ import annotations

from pathlib import Path

from slopewise.models.errors import InputError
from slopewise.services.io.plan_file import joined, write_plan_csv
from slopewise.services.jobs.plan import PlanResult

_SCENE = ".mcap"
"""Ending of a scene; everything else is a CSV table."""

_NO_CSV = (".xlsx", ".xls", ".ods", ".parquet", ".json", ".npz", ".tif", ".toml", ".html", ".pdf")
"""Endings of other formats, which a reader would not open as a table of text."""


def check_plan_name(path: Path | None) -> None:
    """Raise InputError for a name with the ending of another format."""
    if path is not None and path.suffix.lower() in (*_NO_CSV, ".rrd"):  # of rerun
        expected = f"expected a name that ends in .csv or {_SCENE}, got {path.suffix}"
        raise InputError(str(path), "", expected)


def write_plans(result: PlanResult, path: Path) -> None:
    """Write all plans, best first, in the format of the file's ending."""
    if path.suffix.lower() == _SCENE:
        from slopewise.services.scene.foxglove_file import write_mcap

        write_mcap(path, result.elevation_map, result.plans, result.model.vehicle)
    else:
        write_plan_csv(joined(result.plans), path)
