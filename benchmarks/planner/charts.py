"""The result of a benchmark as plotly figures."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

Result = dict[str, Any]


def charts(result: Result) -> list[Any]:
    """Times of all solvers, and growth with stations and candidates."""
    return [
        _bars("In batch", result["batch"]),
        _bars("The time-optimal problem, one candidate", result["single"]),
        _bars("The jerk-limited problem, one candidate", result["smoothing"]),
        _lines("Growth with stations, 16 candidates", "stations", result["growth"]["stations"]),
        _lines(
            "Growth with candidates, 100 stations", "candidates", result["growth"]["candidates"]
        ),
    ]


def _bars(title: str, rows: list[Result]) -> Any:
    known = [row for row in rows if "median" in row]
    figure = go.Figure(
        go.Bar(
            y=[row["name"] for row in known],
            x=[1e3 * row["median"] for row in known],
            orientation="h",
            error_x={
                "type": "data",
                "symmetric": False,
                "array": [1e3 * (row["max"] - row["median"]) for row in known],
                "arrayminus": [1e3 * (row["median"] - row["min"]) for row in known],
            },
        )
    )
    figure.update_layout(title=title, template="plotly_white", yaxis_autorange="reversed")
    figure.update_xaxes(title="time [ms], median and spread", type="log")
    return figure


def _lines(title: str, by: str, rows: list[Result]) -> Any:
    names = list(dict.fromkeys(name for row in rows for name in row))
    figure = go.Figure()
    for name in names:
        if name in ("stations", "candidates"):
            continue
        points = [(row[by], 1e3 * row[name]["median"]) for row in rows if name in row]
        figure.add_scatter(
            x=[x for x, _ in points], y=[y for _, y in points], name=name, mode="lines+markers"
        )
    figure.update_layout(title=title, template="plotly_white")
    figure.update_xaxes(title=by, type="log")
    figure.update_yaxes(title="time [ms]", type="log")
    return figure
