"""The result of a benchmark as tables for a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.table import Table

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


def duration(seconds: float) -> str:
    """A time with a fitting unit: ``3.21 ms``."""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def _spread(row: Result) -> tuple[str, str]:
    return duration(row["median"]), f"{duration(row['min'])} … {duration(row['max'])}"


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column(overflow="fold")
    for column in columns:
        table.add_column(column, justify="right", overflow="fold")
    return table


def _ratio(row: Result, to: str) -> str:
    return f"{row[to]:.3g}× ({row[f'{to}_least']:.3g}×)"


def _batch(result: Result) -> Table:
    problem = result["problem"]
    table = _table(
        f"In batch: {problem['candidates']} candidates of {problem['stations']} stations, "
        "one thread; ratios of medians (of least times)",
        "median", "min … max", "to plain", "to braking",
    )  # fmt: skip
    for row in result["batch"]:
        table.add_row(
            row["name"], *_spread(row), _ratio(row, "to_plain"), _ratio(row, "to_braking")
        )
    return table


def _solvers(title: str, rows: list[Result]) -> Table:
    table = _table(title, "median", "min … max", "solved", "drive", "excess")
    for row in rows:
        if "note" in row:
            table.add_row(row["name"], row["note"])
            continue
        table.add_row(
            row["name"], *_spread(row), f"{row['solved']}/{row['of']}",
            f"{row['travel_time']:.3f} s" if "travel_time" in row else "–",
            f"{row['excess']:.2%}" if "excess" in row else "–",
        )  # fmt: skip
    return table


def _plans(result: Result) -> Table:
    table = _table("One plan that is emitted, and memory", "median", "min … max")
    for row in result["plans"]:
        table.add_row(row["name"], *_spread(row))
    memory = result["memory"]
    table.add_row("arrays of a batch", f"{memory['batch_arrays'] / 1e6:.1f} MB")
    table.add_row("peak of this process", f"{memory['process_peak'] / 1e6:.0f} MB")
    return table


def _growth(title: str, by: str, growth: Result) -> Table:
    rows = growth[by]
    table = _table(title, *(str(row[by]) for row in rows))
    for name in dict.fromkeys(name for row in rows for name in row):
        if name not in ("stations", "candidates"):
            cells = (duration(row[name]["median"]) if name in row else "–" for row in rows)
            table.add_row(name, *cells)
    return table


def _targets(result: Result) -> Table:
    table = _table("Targets", "wanted", "reached", "by least times", "")
    for row in result["targets"]:
        unit = row["unit"]
        reached = (
            "–" if value is None else f"{value:.3g} {unit}"
            for value in (row["value"], row["value_least"])
        )  # fmt: skip
        verdict = {True: "[green]pass", False: "[red]miss", None: "not measured"}[row["passed"]]
        table.add_row(row["name"], f"{row['relation']} {row['limit']:g} {unit}", *reached, verdict)
    return table
