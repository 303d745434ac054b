"""Tables out of Parquet files, if polars is installed. Rows count from 1."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.services.io.access import check_file, fault
from slopewise.services.io.table import Table


def read_parquet(path: Path) -> Table:
    """A Parquet file as a table: numbers as float64 with NaN for null, all else as text."""
    check_file(path)
    try:
        import polars
    except ImportError:
        hint = "expected polars to read Parquet, got none: pip install '.[parquet]' in a clone"
        raise fault(path, "", hint) from None
    try:
        frame = polars.read_parquet(path, glob=False)
        columns = {name: _cells(polars, frame[name]) for name in frame.columns}
    except (polars.exceptions.PolarsError, polars.exceptions.PanicException, OSError) as error:
        found = type(error).__name__
        raise fault(path, "", f"expected an intact Parquet file, got {found}") from None
    return Table(str(path), columns, range(1, len(frame) + 1))


def _cells(polars: Any, series: Any) -> list[str] | Floats:
    if series.dtype.is_numeric() or series.dtype in (polars.Boolean, polars.Null):
        numbers: Floats = series.cast(polars.Float64).fill_null(np.nan).to_numpy()
        return numbers
    return ["" if cell is None else str(cell) for cell in series.to_list()]
