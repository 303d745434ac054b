"""What is kept of each vehicle's comparison: a row of Parquet, which makes it finished.

`findings/NAME.parquet` is written after the files in `vehicles/NAME/`, all or nothing, and carries
the key of what was asked: logs, model, settings, version. Nothing in it depends on who did the work
or how long it took, so the same question gives the same bytes.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from slopewise.services.io.files import write_atomic

DONE, REFUSED, FAILED = "done", "refused", "failed"
"""Looked at; its logs cannot be, and why; or the work broke off, and is tried again by another run.
"""

FINDINGS, VEHICLES = "findings", "vehicles"

Row = dict[str, Any]

_GAPS = ("gap", "stop_distance")
_OF_GAP = ("before", "refit", "after", "noise_floor", "closed")


def without_answer(vehicle: str, key: str, status: str, reason: str) -> Row:
    """The row of a vehicle that nothing can be said of."""
    return {"vehicle": vehicle, "key": key, "status": status, "reason": reason}


def answered(vehicle: str, key: str, told: dict[str, Any]) -> Row:
    """The row of a vehicle out of what its discrepancy.json holds."""
    effects = [
        effect | {"parameters": [{"name": n, **v} for n, v in effect["parameters"].items()]}
        for effect in told["effects"]
    ]
    row = without_answer(vehicle, key, DONE, "") | {"effects": effects}
    row |= {name: told[name] for name in ("verdict", "summary", "stops", "notes")}
    for gap in _GAPS:
        row |= {f"{gap}_{name}": told[gap][name] for name in _OF_GAP}
    return row | {"next_experiment": told["next_experiment"]["text"]}


def write(folder: Path, row: Row) -> None:
    """Write the row of one vehicle.

    Raises:
        InputError: the folder cannot be written to.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    pq.write_table(pa.Table.from_pylist([row], schema=_schema(pa)), buffer, compression="zstd")
    write_atomic(_file(folder, row["vehicle"]), buffer.getvalue())


def read(folder: Path, vehicle: str, key: str) -> Row | None:
    """The row of a vehicle if it answers this very question; None also where it is damaged."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = _file(folder, vehicle)
    if not file.is_file():
        return None
    try:
        row: Row = pq.ParquetFile(file).read().to_pylist()[0]
    except (pa.ArrowException, OSError, IndexError):
        return None
    return row if row.get("key") == key else None


def _file(folder: Path, vehicle: str) -> Path:
    return folder / FINDINGS / f"{vehicle}.parquet"


def _schema(pa: Any) -> Any:
    text, number = pa.string(), pa.float64()
    parameter = pa.struct([("name", text), ("value", number), ("std", number), ("unit", text)])
    effect = pa.struct(
        [
            ("name", text),
            ("confidence", number),
            ("alternatives", pa.list_(text)),
            ("where", text),
            ("parameters", pa.list_(parameter)),
        ]
    )
    return pa.schema(
        [
            *((name, text) for name in ("vehicle", "key", "status", "reason", "verdict")),
            ("summary", text),
            ("stops", pa.int64()),
            ("effects", pa.list_(effect)),
            *((f"{gap}_{name}", number) for gap in _GAPS for name in _OF_GAP),
            ("notes", pa.list_(text)),
            ("next_experiment", text),
        ]
    )
