"""The brake sheet as a drawing: text, a table and a chart on one page of A4."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from slopewise.services.report.brake_numbers import BrakeNumbers
from slopewise.services.report.brake_table import DistanceTable
from slopewise.services.report.brake_words import (
    brake_rows,
    danger,
    degrees,
    explained,
    metres,
    slope_rows,
)
from slopewise.services.report.figures import COLOURS, FAINT, INK, SECOND

SIZE = (8.27, 11.69)
"""A4, upright [inch]."""

_LEFT, _RIGHT, _MIDDLE = 0.07, 0.93, 0.51
_LINE = 0.0152
_BAD, _SOFT = "#a82a0c", "#4d5358"


class SheetWords(NamedTuple):
    """What does not follow from the model.

    Attributes:
        title: of the sheet. facts: what the stops say, name -> value.
        trace: lines of what it was made from.
    """

    title: str
    facts: Mapping[str, str]
    trace: str


def draw(
    figure: Any,
    numbers: BrakeNumbers,
    table: DistanceTable,
    words: SheetWords,
) -> Any:
    """Draw on an empty figure of :data:`SIZE`, and give it back."""
    title, facts, trace = words
    figure.text(_LEFT, 0.957, title, fontsize=18, weight="bold")
    survive = f"quantile {numbers.survive.quantile:g}"
    figure.text(
        _LEFT,
        0.947,
        f"Stops on even ground: mean of the model, and what plans count on at the {survive}.\n"
        "The drive held or cut through the dead time, whichever is longer.",
        fontsize=8.5,
        va="top",
        color=_SOFT,
    )
    _rows(figure, _LEFT, 0.905, "Brakes", brake_rows(numbers, table))
    _rows(figure, _MIDDLE, 0.905, "Slopes and evidence", {**slope_rows(numbers), **facts})
    _head(figure, _LEFT, 0.727, f"Stopping distance, m: at the {survive} with offset / mean")
    _distances(figure, 0.714, table)
    below = 0.714 - _LINE * (len(table.speeds) + 2.2)
    _head(figure, _LEFT, below, "Against rules that know no slope")
    figure.text(_LEFT, below - 0.009, danger(numbers, table), fontsize=7.8, va="top", color=_BAD)
    low = 0.225
    _chart(figure.add_axes((0.115, low, 0.425, below - 0.035 - low)), numbers, table)
    _rules(figure, below - 0.045, numbers, table)
    _head(figure, _LEFT, 0.175, "Traceability")
    figure.text(_LEFT, 0.167, trace, fontsize=6.1, va="top", family="monospace", linespacing=1.35)
    return figure


def _head(figure: Any, x: float, y: float, words: str) -> None:
    figure.text(x, y, words, fontsize=10.5, weight="bold", color=INK)


def _rows(figure: Any, x: float, y: float, head: str, rows: Mapping[str, str]) -> None:
    _head(figure, x, y, head)
    for number, (name, value) in enumerate(rows.items(), start=1):
        figure.text(x, y - 0.003 - _LINE * number, name, fontsize=8, color=_SOFT)
        figure.text(x + 0.17, y - 0.003 - _LINE * number, value, fontsize=8)


def _distances(figure: Any, y: float, table: DistanceTable) -> None:
    step = (_RIGHT - _LEFT - 0.075) / len(table.grades)
    columns = _LEFT + 0.075 + step * (np.arange(len(table.grades)) + 1.0)
    y -= 0.8 * _LINE
    figure.text(_LEFT, y, "v, m/s", fontsize=8, color=_SOFT)
    for x, grade in zip(columns, table.grades, strict=True):
        figure.text(x, y, degrees(grade), fontsize=8, ha="right", color=_SOFT)
    for i, speed in enumerate(table.speeds):
        row = y - _LINE * (i + 1)
        figure.text(_LEFT, row, f"{speed:.2f}", fontsize=8)
        for j, x in enumerate(columns):
            both = f"{metres(table.allowed[i, j])} / {metres(table.mean[i, j])}"
            figure.text(x, row, both, fontsize=8, ha="right")
        line = [row + 0.72 * _LINE] * 2
        figure.add_artist(_line(figure, [_LEFT, _RIGHT], line))


def _line(figure: Any, x: list[float], y: list[float]) -> Any:
    from matplotlib.lines import Line2D

    return Line2D(x, y, lw=0.4, color=FAINT, transform=figure.transFigure)


def _chart(axes: Any, numbers: BrakeNumbers, table: DistanceTable) -> None:
    """Stops without offset over the grade; where a rule is shorter the gap is filled."""
    fine = np.linspace(table.grades[0], table.grades[-1], 25)
    count = len(table.speeds)
    for colour, i in zip(COLOURS[::3], sorted({count - 1, count // 2, 0}), strict=False):
        speed = float(table.speeds[i])
        needed = np.array([numbers.allowed_distance(speed, float(g)) for g in fine])
        needed = np.where(np.isfinite(needed), needed - numbers.offset, np.nan)
        across = np.rad2deg(fine)
        axes.plot(across, needed, color=colour, label=f"{speed:.2f} m/s")
        axes.axhline(table.rule[i], color=colour, lw=0.9, ls="--")
        axes.fill_between(
            across,
            table.rule[i],
            needed,
            where=needed > table.rule[i],
            color=SECOND,
            alpha=0.18,
            lw=0,
        )
    axes.set(xlabel="grade, ° (uphill positive)", ylabel="stop at the quantile, m", ylim=(0, None))
    axes.legend(fontsize=7.5, title="dashed: RSS", title_fontsize=7.5)


def _rules(figure: Any, y: float, numbers: BrakeNumbers, table: DistanceTable) -> None:
    """The steepest descent, speed by speed, and what each rule lacks there."""
    x = 0.585
    columns = np.linspace(x + 0.115, _RIGHT, 4)
    figure.text(x, y, f"On {degrees(float(table.grades[0]))}, m", fontsize=8, weight="bold")
    y -= 1.1 * _LINE
    names = ("model", "RSS", "lacks", "v²/2a")
    for at, name in zip((x, *columns), ("v, m/s", *names), strict=True):
        figure.text(at, y, name, fontsize=8, ha="left" if at == x else "right", color=_SOFT)
    for i, speed in enumerate(table.speeds):
        y -= _LINE
        needed = float(table.allowed[i, 0]) - numbers.offset
        lacks = needed - table.rule[i]
        figure.text(x, y, f"{speed:.2f}", fontsize=8)
        cells = (metres(needed), metres(table.rule[i]), metres(lacks), metres(table.plain[i]))
        for at, cell, name in zip(columns, cells, names, strict=True):
            colour = _BAD if name == "lacks" and lacks > 5e-3 else INK
            figure.text(at, y, cell, fontsize=8, ha="right", color=colour)
    figure.text(
        x,
        y - 1.3 * _LINE,
        explained(numbers, table),
        fontsize=7.2,
        va="top",
        color=_SOFT,
        linespacing=1.4,
    )
