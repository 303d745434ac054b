"""The benchmark's figures as plotly figures."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

Result = dict[str, Any]

_COLOURS = {True: "#2a7f62", False: "#c0392b", None: "#7f8c8d"}


def charts(result: Result) -> list[Any]:
    """Shares with their intervals, gap closed, and what small expected χ² does to names."""
    figures = [_shares("hidden effects", result["metrics"])]
    if "engine" in result:
        figures.append(_shares("in the physics engine", result["engine"]))
    if "multibody" in result:
        figures.append(_shares("with the multi-body car", result["multibody"]))
    outcomes = result["outcomes"]
    return [*figures, _closed(outcomes), _by_worth(outcomes)]


def _shares(title: str, rows: list[Result]) -> Any:
    known = [row for row in rows if row["unit"] == "%" and row["reached"] is not None]
    figure = go.Figure(
        go.Scatter(
            x=[100.0 * row["reached"] for row in known],
            y=[row["what"] for row in known],
            mode="markers",
            marker={"color": [_COLOURS[row["passed"]] for row in known], "size": 9},
            error_x={
                "type": "data",
                "symmetric": False,
                "array": [100.0 * (row["high"] - row["reached"]) for row in known],
                "arrayminus": [100.0 * (row["reached"] - row["low"]) for row in known],
            },
        )
    )
    figure.update_layout(
        title=f"{title}: shares with 95 % Wilson intervals",
        template="plotly_white",
        yaxis_autorange="reversed",
        xaxis_title="%",
    )
    return figure


def _closed(outcomes: list[Result]) -> Any:
    known = [o for o in outcomes if o["identifiable"] and o["closed"] is not None]
    figure = go.Figure()
    for kind in ("single", "pair", "off"):
        shares = sorted(100.0 * o["closed"] for o in known if o["kind"] == kind)
        if shares:
            rank = [(i + 0.5) / len(shares) for i in range(len(shares))]
            figure.add_scatter(x=shares, y=rank, name=kind, mode="lines+markers")
    figure.update_layout(
        title="Share of the closable gap that is closed on fresh stops",
        template="plotly_white",
        xaxis={"title": "%", "range": [-20.0, 105.0]},
        yaxis_title="share of sets",
    )
    return figure


def _by_worth(outcomes: list[Result]) -> Any:
    known = [o for o in outcomes if o["kind"] in ("single", "faint") and o["gap"] > 0.0]
    figure = go.Figure()
    verdicts = {
        "right": [o for o in known if o["right"]],
        "wrong": [o for o in known if o["wrong"]],
        "no name": [o for o in known if not (o["right"] or o["wrong"])],
    }
    for name, group in verdicts.items():
        figure.add_scatter(
            x=[o["gap"] for o in group],
            y=[max(o["apart"], 0.1) for o in group],
            name=name,
            mode="markers",
            text=[f"{o['truth'][0]}: {o['verdict']}" for o in group],
        )
    figure.update_layout(title="What was said, by what can be known", template="plotly_white")
    figure.update_xaxes(title="expected χ² of the effect", type="log")
    figure.update_yaxes(title="expected χ² to the nearest rival", type="log")
    return figure
