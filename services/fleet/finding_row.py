"""Row of one vehicle's comparison, as Parquet; a vehicle is finished once it is written.

`findings/NAME.parquet` is written after the files in `vehicles/NAME/`, all or nothing, and carries
the key of the task: logs, model, settings, version. It does not depend on the worker or on how long
it took, so the same task gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from slopewise.services.fleet.parquet_results import write_parquet

DONE, REFUSED, FAILED = "done", "refused", "failed"
"""Status: examined; logs rejected, with the reason; or failed, and tried again by another run."""

FINDINGS, VEHICLES = "findings", "vehicles"

Row = dict[str, Any]

_GAPS = ("gap", "stop_distance")
_OF_GAP = ("before", "refit", "after", "noise_floor", "closed")


def failed_finding(vehicle: str, key: str, status: str, reason: str) -> Row:
    """Row of a vehicle without a finding."""
    return {"vehicle": vehicle, "key": key, "status": status, "reason": reason}


def finding_row(vehicle: str, key: str, findings: dict[str, Any]) -> Row:
    """Row of a vehicle from the content of its discrepancy.json."""
    effects = [
        effect | {"parameters": [{"name": n, **v} for n, v in effect["parameters"].items()]}
        for effect in findings["effects"]
    ]
    row = failed_finding(vehicle, key, DONE, "") | {"effects": effects}
    row |= {name: findings[name] for name in ("verdict", "summary", "stops", "notes")}
    for gap in _GAPS:
        row |= {f"{gap}_{name}": findings[gap][name] for name in _OF_GAP}
    return row | {"next_experiment": findings["next_experiment"]["text"]}


def write(folder: Path, row: Row) -> None:
    """Write the row of one vehicle."""
    import pyarrow as pa

    write_parquet(_file(folder, row["vehicle"]), pa.Table.from_pylist([row], schema=_schema(pa)))


def read(folder: Path, vehicle: str, key: str) -> Row | None:
    """Row of a vehicle if it is of this task; None also where it is damaged."""
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
