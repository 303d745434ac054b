"""One picture of a fleet: surprises in metres, and under them the effects that explain them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from slopewise.services.fleet.census import NAMED, RIVALS
from slopewise.services.fleet.finding import Row
from slopewise.services.report.figures import FAINT, FIRST, INK, SECOND, house_style, svg_uri

_NAMES = 40  # vehicles that have room for their names
_SIZE = 46.0
_FAINTEST = 0.25


def picture(rows: Sequence[Row], effects: Sequence[str]) -> str:
    """Data URI of an SVG.

    Args:
        rows: of vehicles with an answer, in the order in which they are drawn.
        effects: in the order of their lines.

    Raises:
        InputError: matplotlib is not installed.
    """
    with house_style() as make:
        lines = max(len(effects), 1)
        figure = make((11.0, 3.6 + 0.3 * lines), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 0.3 * lines + 0.2))
        _surprises(above, rows)
        _effects(below, rows, effects)
        below.set_xlim(-0.6, max(len(rows) - 0.4, 0.6))
        if len(rows) <= _NAMES:
            names = [row["vehicle"] for row in rows]
            below.set_xticks(range(len(rows)), names, rotation=60, ha="right")
        else:
            from matplotlib.ticker import MaxNLocator

            below.xaxis.set_major_locator(MaxNLocator(integer=True))
            below.set_xlabel("vehicles, the largest surprise first")
        return svg_uri(figure)


def _surprises(axes: Any, rows: Sequence[Row]) -> None:
    x = range(len(rows))
    before = [row["stop_distance_before"] for row in rows]
    after = [row["stop_distance_after"] for row in rows]
    axes.vlines(x, before, after, color=FAINT, lw=1.0)
    axes.plot(x, before, "o", ms=4.6, color=SECOND, label="by the model so far")
    axes.plot(x, after, "o", ms=4.6, color=FIRST, label="with what was found")
    axes.set(ylabel="stops are off by [m]", ylim=(0.0, None))
    axes.legend(fontsize=8.5)


def _effects(axes: Any, rows: Sequence[Row], effects: Sequence[str]) -> None:
    line = {name: i for i, name in enumerate(effects)}
    for x, row in enumerate(rows):
        for effect in row["effects"]:
            if row["verdict"] == NAMED:
                alpha = _FAINTEST + (1.0 - _FAINTEST) * min(max(effect["confidence"], 0.0), 1.0)
                axes.scatter(x, line[effect["name"]], s=_SIZE, color=INK, alpha=alpha, lw=0)
            elif row["verdict"] == RIVALS:
                for name in (effect["name"], *effect["alternatives"]):
                    axes.scatter(x, line[name], s=_SIZE, facecolors="none", edgecolors=INK, lw=1.1)
    axes.set_yticks(range(len(effects)), [name.replace("_", " ") for name in effects])
    axes.set_ylim(max(len(effects), 1) - 0.5, -0.5)
