"""Plans as partitioned Parquet: `plans/` one row per station, `candidates/` one per candidate.

A part is finished once its file in `candidates/` is there: it is written last, and all or nothing.
The same plans give the same bytes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from slopewise.planner.plan import SpeedPlan
from slopewise.services.fleet.result_folder import write_parquet
from slopewise.services.io.files import fault
from slopewise.services.io.plan_file import COLUMNS, TEXT, joined, summary
from slopewise.services.jobs.plan import RefusedPath

REFUSED = "refused"  # Status of a candidate that cannot be driven forward; its reason explains it
PLANS, CANDIDATES = "plans", "candidates"

_NUMBERS = (*(name for name in COLUMNS if name not in TEXT), "side_load", "path_deviation")
_TOTALS = (
    "travel_time",
    "progress",
    "length",
    "max_speed",
    "clear_distance",
    "least_margin",
    "least_rear_load",
    "path_deviation",
)


def write_part(
    folder: Path, file: str, source: str, answers: Sequence[SpeedPlan | RefusedPath]
) -> None:
    """Write a part, finished with the second file."""
    import pyarrow as pa

    plans = [answer for answer in answers if isinstance(answer, SpeedPlan)]
    write_parquet(folder / PLANS / file, _stations(plans, source, pa))
    texts = [(name, pa.string()) for name in ("source", "candidate", "status", "reason")]
    numbers = [(name, pa.float64()) for name in _TOTALS]
    schema = pa.schema([*texts, ("admissible", pa.bool_()), *numbers])
    table = pa.Table.from_pylist([_row(answer, source) for answer in answers], schema=schema)
    write_parquet(folder / CANDIDATES / file, table)


def is_finished(folder: Path, file: str) -> bool:
    """True if the part was written completely."""
    return (folder / CANDIDATES / file).is_file() and (folder / PLANS / file).is_file()


def count(folder: Path, files: Iterable[str]) -> tuple[Counter[str], int]:
    """Candidates of these parts by status, and the number that may be driven."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    statuses: Counter[str] = Counter()
    admissible = 0
    for file in files:
        path = folder / CANDIDATES / file
        try:
            table = pq.read_table(path, columns=["status", "admissible"])
            path = folder / PLANS / file
            pq.read_metadata(path)  # at its end: a part that was cut has none
        except (pa.ArrowException, OSError):
            message = "expected an intact part: remove it and run again, got something else"
            raise fault(path, "", message) from None
        statuses.update(table["status"].to_pylist())
        admissible += sum(table["admissible"].to_pylist())
    return statuses, admissible


def _row(answer: SpeedPlan | RefusedPath, source: str) -> dict[str, Any]:
    if isinstance(answer, RefusedPath):
        return {"source": source, "admissible": False, "status": REFUSED, **answer._asdict()}
    deviation = answer.path_deviation
    row = {"source": source, "admissible": answer.admissible, **summary(answer)}
    return {**row, "path_deviation": None if deviation is None else deviation.largest}


def _stations(plans: Sequence[SpeedPlan], source: str, pa: Any) -> Any:
    """Columns of a plan file, and the file of the path."""
    columns = joined(plans)
    columns["source"] = [source] * len(columns.get("station", ()))
    kinds = dict.fromkeys(("source", *TEXT), pa.string()) | dict.fromkeys(_NUMBERS, pa.float64())
    return pa.table({name: pa.array(columns.get(name, ()), kind) for name, kind in kinds.items()})
