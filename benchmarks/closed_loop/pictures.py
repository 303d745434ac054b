"""Pictures of the closed loop: stops as in Fig. 6 of Braking, policies side by side, one drive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from benchmarks.closed_loop.campaign import Campaign
from benchmarks.closed_loop.drive import Drive
from benchmarks.closed_loop.terrain import SURFACES

STRIP = 1
"""Number of the scene that is shown as a strip."""

FRAMES = 5
"""Of the strip."""

_COLOURS = ("#35608d", "#c8862b", "#4f8a4b")


def write(campaign: Campaign, folder: Path, frames: list[tuple[float, Any]]) -> list[Path]:
    """Write all pictures as PNG.

    Args:
        campaign: what was driven. folder: made if need be.
        frames: (time, image) of one drive, may be empty.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mpl.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    drive = campaign.drives["slopewise"][STRIP]
    figures = {
        "stops.png": stops(campaign.result["stops"]),
        "policies.png": policies(campaign.result["policies"]),
        "drive.png": strip(drive, frames),
    }
    paths = []
    for name, figure in figures.items():
        figure.savefig(folder / name, dpi=130)
        paths.append(folder / name)
    return paths


def stops(rows: list[dict[str, Any]]) -> Figure:
    """Predicted and actual stopping distance, stop by stop and over each other."""
    actual = np.array([row["actual"] for row in rows])
    predicted = np.array([row["predicted"] for row in rows])
    surface = np.array([SURFACES.index(row["surface"]) for row in rows])
    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.7, 1.0))
    order = np.argsort(actual)
    left.plot(predicted[order], ".", ms=2.5, color="#c0392b", label="predicted")
    left.plot(actual[order], ".", ms=2.5, color="#222222", label="actual")
    left.set_xlabel("stop, by its length")
    left.set_ylabel("stopping distance [m]")
    left.legend(frameon=False, markerscale=3)
    most = 1.05 * float(predicted.max())
    right.plot((0.0, most), (0.0, most), color="#999999", lw=0.8)
    for index, name in enumerate(SURFACES):
        of = surface == index
        right.plot(actual[of], predicted[of], ".", ms=3, color=_COLOURS[index], label=name)
    right.set_xlabel("actual [m]")
    right.set_ylabel("predicted [m]")
    right.set_aspect("equal")
    right.legend(frameon=False, markerscale=3)
    excess = predicted - actual
    figure.suptitle(
        f"{len(rows)} emergency stops: {np.mean(excess >= 0.0):.2%} not longer than predicted, "
        f"prediction {np.mean(excess):.2f} m above on average",
        x=0.01, ha="left",
    )  # fmt: skip
    return figure


def policies(results: dict[str, dict[str, Any]]) -> Figure:
    """Speed and accidents of every policy."""
    names = list(results)
    rows = np.arange(len(names))[::-1]
    figure = Figure(figsize=(11.0, 3.4), layout="constrained")
    columns = (
        ("mean_speed", "mean speed [m/s]", "{:.2f}"),
        ("collisions", "collisions", "{:.0f}"),
        ("past_clear", "times past the clear distance", "{:.0f}"),
    )
    for axes, (key, title, form) in zip(figure.subplots(1, 3, sharey=True), columns, strict=True):
        values = [results[name][key] for name in names]
        colours = ["#35608d" if name == "slopewise" else "#b8c4d0" for name in names]
        bars = axes.barh(rows, values, color=colours)
        axes.bar_label(bars, [form.format(v) for v in values], padding=3)
        axes.set_title(title, loc="left", fontsize=9)
        axes.set_yticks(rows, names)
        axes.margins(x=0.15)
    return figure


def strip(drive: Drive, frames: list[tuple[float, Any]]) -> Figure:
    """One drive: what it looked like, how fast it was, how far it could see."""
    h = drive.history
    figure = Figure(figsize=(11.0, 5.8 if frames else 4.4), layout="constrained")
    if frames:
        above, below = figure.subfigures(2, 1, height_ratios=(1.0, 2.1))
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
