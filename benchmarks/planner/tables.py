"""What `slopewise bench` measured, as tables for a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from ..common.tables import duration, table_of

Result = dict[str, Any]


def tables(result: Result) -> Iterator[Table]:
    """All of them, the verdict last."""
    yield _batch(result)
    title = "The time-optimal problem, one candidate (N = {stations})"
    yield _solvers(title.format(**result["problem"]), result["single"])
    yield _solvers("The jerk-limited problem, the same candidates", result["smoothing"])
    yield _plans(result)
    yield _growth("Growth with stations, 16 candidates", "stations", result["growth"])
    yield _growth("Growth with candidates, 100 stations", "candidates", result["growth"])
    yield _targets(result)


def _spread(row: Result) -> tuple[str, str]:
    return duration(row["median"]), f"{duration(row['min'])} … {duration(row['max'])}"


def _ratio(row: Result, to: str) -> str:
    return f"{row[to]:.3g}× ({row[f'{to}_least']:.3g}×)"


def _batch(result: Result) -> Table:
    problem = result["problem"]
    table = table_of(
        f"In batch: {problem['candidates']} candidates of {problem['stations']} stations, "
        "one thread; ratios of medians (of least times)",
        "median",
        "min … max",
        "to plain",
        "to braking",
    )
    for row in result["batch"]:
        table.add_row(
            row["name"], *_spread(row), _ratio(row, "to_plain"), _ratio(row, "to_braking")
        )
    return table


def _solvers(title: str, rows: list[Result]) -> Table:
    table = table_of(title, "median", "min … max", "solved", "drive", "excess")
    for row in rows:
        if "note" in row:
            table.add_row(row["name"], row["note"])
            continue
        table.add_row(
            row["name"],
            *_spread(row),
            f"{row['solved']}/{row['of']}",
            f"{row['travel_time']:.3f} s" if "travel_time" in row else "–",
            f"{row['excess']:.2%}" if "excess" in row else "–",
        )
    return table


def _plans(result: Result) -> Table:
    table = table_of("One plan that is emitted, and memory", "median", "min … max")
    for row in result["plans"]:
        table.add_row(row["name"], *_spread(row))
    memory = result["memory"]
    table.add_row("arrays of a batch", f"{memory['batch_arrays'] / 1e6:.1f} MB")
    table.add_row("peak of this process", f"{memory['process_peak'] / 1e6:.0f} MB")
    return table


def _growth(title: str, by: str, growth: Result) -> Table:
    rows = growth[by]
    table = table_of(title, *(str(row[by]) for row in rows))
    for name in dict.fromkeys(name for row in rows for name in row):
        if name not in ("stations", "candidates"):
            cells = (duration(row[name]["median"]) if name in row else "–" for row in rows)
            table.add_row(name, *cells)
    return table


def _targets(result: Result) -> Table:
    table = table_of("Targets", "wanted", "reached", "by least times", "")
    for row in result["targets"]:
        unit = row["unit"]
        reached = (
            "–" if value is None else f"{value:.3g} {unit}"
            for value in (row["value"], row["value_least"])
        )
        verdict = {True: "[green]pass", False: "[red]miss", None: "not measured"}[row["passed"]]
        table.add_row(row["name"], f"{row['relation']} {row['limit']:g} {unit}", *reached, verdict)
    return table
