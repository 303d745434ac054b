"""Pictures of the closed loop: stops as in Fig. 6 of Braking, policies side by side, one drive."""

from __future__ import annotations

import io
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from .campaign import Campaign
from .film import Frame, film
from .moving_horizon import MovingHorizon
from .records import DrivenScene
from .terrain import SURFACES

_STRIP = 1  # number of the scene that is shown as a strip
_FRAMES = 5
_COLOURS = ("#35608d", "#c8862b", "#4f8a4b")


def draw(campaign: Campaign, frames: list[tuple[float, Any]]) -> dict[str, bytes]:
    """All pictures as PNG, by name.

    Args:
        campaign: what was driven. frames: (time, image) of one drive, may be empty.
    """
    mpl.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figures = {
        "stops": stops(campaign.result["stops"]),
        "policies": policies(campaign.result["policies"]),
        "drive": strip(campaign.drives["slopewise"][_STRIP], frames),
    }
    return {name: _png(figure) for name, figure in figures.items()}


def frames(campaign: Campaign) -> list[Frame]:
    """Frames of one drive, for the strip.

    Raises:
        RuntimeError: nothing can be drawn here.
    """
    return film(_STRIP, campaign.dem, MovingHorizon(campaign.model), _FRAMES)


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()


def stops(rows: list[dict[str, Any]]) -> Figure:
    """Predicted and actual stopping distance, stop by stop and over each other."""
    actual = np.array([row["actual"] for row in rows])
    predicted = np.array([row["predicted"] for row in rows])
    surface = np.array([SURFACES.index(row["surface"]) for row in rows])
    grade = np.rad2deg([row["grade"] for row in rows])
    excess = predicted - actual
    figure = Figure(figsize=(13.0, 4.2), layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.6, 1.0, 1.0))
    order = np.argsort(actual)
    left.plot(predicted[order], ".", ms=2.5, color="#c0392b", label="predicted")
    left.plot(actual[order], ".", ms=2.5, color="#222222", label="actual")
    left.set_xlabel("stop, by its length")
    left.set_ylabel("stopping distance [m]")
    left.legend(frameon=False, markerscale=3)
    most = 1.05 * float(predicted.max())
    middle.plot((0.0, most), (0.0, most), color="#999999", lw=0.8)
    right.axhline(0.0, color="#999999", lw=0.8)
    for index, name in enumerate(SURFACES):
        of = surface == index
        middle.plot(actual[of], predicted[of], ".", ms=3, color=_COLOURS[index], label=name)
        right.plot(grade[of], excess[of], ".", ms=3, color=_COLOURS[index])
    middle.set_xlabel("actual [m]")
    middle.set_ylabel("predicted [m]")
    middle.set_aspect("equal")
    middle.legend(frameon=False, markerscale=3)
    right.set_xlabel("grade at the command [°]")
    right.set_ylabel("predicted − actual [m]")
    figure.suptitle(
        f"{len(rows)} emergency stops: {np.mean(excess >= 0.0):.2%} not longer than predicted, "
        f"prediction {np.mean(excess):.2f} m above on average",
        x=0.01,
        ha="left",
    )
    return figure


def policies(results: dict[str, dict[str, Any]]) -> Figure:
    """Speed and accidents of every policy."""
    names = list(results)
    rows = np.arange(len(names))[::-1]
    figure = Figure(figsize=(11.0, 3.4), layout="constrained")
    columns = (
        ("mean_speed", "mean speed [m/s]", "{:.2f}", None),
        ("collisions", "collisions in 100 forced stops", "{:.1f}", "forced_stops"),
        ("past_clear", "times past the clear distance in 100", "{:.1f}", "forced_stops"),
    )
    for axes, column in zip(figure.subplots(1, 3, sharey=True), columns, strict=True):
        key, title, form, per = column
        hundreds = [results[name][per] / 100.0 if per else 1.0 for name in names]
        values = [results[name][key] / of for name, of in zip(names, hundreds, strict=True)]
        colours = ["#35608d" if name == "slopewise" else "#b8c4d0" for name in names]
        bars = axes.barh(rows, values, color=colours)
        axes.bar_label(bars, [form.format(v) for v in values], padding=3)
        axes.set_title(title, loc="left", fontsize=9)
        axes.set_yticks(rows, names)
        axes.margins(x=0.15)
    return figure


def strip(drive: DrivenScene, frames: list[tuple[float, Any]]) -> Figure:
    """One drive: what it looked like, how fast it was, how far it could see."""
    h = drive.history
    figure = Figure(figsize=(11.0, 5.8 if frames else 4.4), layout="constrained")
    if frames:
        parts: Any = figure.subfigures(2, 1, height_ratios=(1.0, 2.1))
        above, below = parts
        for axes, (time, image) in zip(above.subplots(1, len(frames)), frames, strict=True):
            axes.imshow(image)
            axes.set_axis_off()
            axes.set_title(f"{time:.1f} s", fontsize=8)
    else:
        below = figure
    speed, sight = below.subplots(2, 1, sharex=True)
    speed.plot(h[:, 0], h[:, 2], color="#222222", lw=1.2)
    speed.set_ylabel("speed [m/s]")
    grade = speed.twinx()
    grade.fill_between(h[:, 0], np.rad2deg(h[:, 5]), color="#c8862b", alpha=0.25, lw=0)
    grade.set_ylabel("grade [°]")
    sight.plot(h[:, 0], h[:, 1], color="#222222", lw=1.2, label="vehicle")
    sight.plot(h[:, 0], h[:, 3], color="#35608d", lw=1.0, label="known to be free")
    sight.plot(h[:, 0], h[:, 4], color="#c0392b", lw=0.8, ls="--", label="barred")
    sight.set_ylabel("station [m]")
    sight.set_xlabel("time [s]")
    sight.legend(frameon=False, loc="upper left")
    below.suptitle(drive.source, x=0.01, ha="left")
    return figure
