"""Tables of the benchmark's figures."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from ..common.text_tables import table_of
from .baselines import TITLES

Result = dict[str, Any]

_METRICS = (
    ("metrics", "hidden effects"),
    ("engine", "in the physics engine"),
    ("multibody", "with the multi-body car"),
)
_BY_EFFECT = (
    ("by_effect", "by effect"),
    ("engine_by_effect", "in the engine"),
    ("multibody_by_effect", "with the car"),
)

_BASELINES = (
    ("peer", "the same sets"),
    ("engine_peer", "the same sets of the engine"),
    ("multibody_peer", "the same sets of the car"),
)


def tables(result: Result) -> Iterator[Table]:
    """Targets and values reached, counts by effect, then the other methods."""
    for key, title in _METRICS:
        if key in result:
            yield _metric_table(title, result[key])
    for key, title in _BY_EFFECT:
        if key in result:
            yield _effect_table(title, result[key])
    if "ambiguity" in result:
        yield _metric_table("distinguishing alternatives", result["ambiguity"])
    for key, title in _BASELINES:
        if isinstance(result.get(key), list):
            yield _baseline_table(title, result[key])


def _metric_table(title: str, rows: list[Result]) -> Table:
    columns = ("target", "reached", "95 % interval or quartiles", "of", "")
    table = table_of(title, *columns, first="what")
    for row in rows:
        verdict = {True: "[green]pass", False: "[red]miss", None: ""}[row["passed"]]
        table.add_row(row["what"], _target(row), *_reached(row), verdict)
    return table


def _target(row: Result) -> str:
    if not row["relation"]:
        return "–"
    if row["relation"] == "in":
        low, high = row["wanted"]
        return f"{low:.0%} … {high:.0%}"
    sign = {">=": "≥", "<=": "≤"}[row["relation"]]
    return f"{sign} {_value(row, row['wanted'])}"


def _reached(row: Result) -> tuple[str, str, str]:
    if row["reached"] is None:
        return "–", "", "0"
    of = f"{row['hits']}/{row['of']}" if row["unit"] == "%" else str(row["of"])
    interval = f"{_value(row, row['low'])} … {_value(row, row['high'])}"
    return _value(row, row["reached"]), interval, of


def _value(row: Result, value: float) -> str:
    if row["unit"] in ("%", "share"):
        return f"{value:.1%}"
    return f"{value:.3g} {row['unit']}".strip()


def _effect_table(title: str, rows: list[Result]) -> Table:
    table = Table(title=title, title_justify="left")
    for column in ("kind", "effect"):
        table.add_column(column, overflow="fold")
    for column in ("sets", "identifiable", "right", "wrong", "axis", "closed"):
        table.add_column(column, justify="right")
    table.add_column("verdicts", overflow="fold")
    for row in rows:
        verdicts = ", ".join(f"{name} {count}" for name, count in sorted(row["verdicts"].items()))
        closed = "–" if row["closed"] is None else f"{row['closed']:.0%}"
        counts = (str(row[key]) for key in ("sets", "identifiable", "right", "wrong"))
        axis = "–" if row["axis"] is None else str(row["axis"])
        table.add_row(row["kind"], row["effect"], *counts, axis, closed, verdicts)
    return table


def _baseline_table(title: str, rows: list[Result]) -> Table:
    """Shares of the methods, with intervals if there are only two."""
    keys = [key for key in TITLES if key in rows[0]]
    several = len(keys) > 2
    columns = [text for key in keys for text in ([TITLES[key]] if several else [TITLES[key], ""])]
    table = table_of(title, *columns, first="what")
    for row in rows:
        cells = []
        for key in keys:
            reached, interval, of = _reached(row[key]) if key in row else ("–", "", "0")
            cells += [of] if several else [f"{reached} ({of})", interval]
        table.add_row(row["what"], *cells)
    return table
