"""Pictures of a calibration as SVG: the papers' figures, remade on the user's own stops.

Braking, Fig. 2 (one stop with its onset), Fig. 3 (force over slope and speed) and Fig. 6 (predicted
and actual stopping distance, stop by stop).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from slopewise.models.calibration.learn import Calibration
from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.services.report.figures import FAINT, FIRST, INK, SECOND, house_style, svg_uri

_WIDE = (7.4, 4.2)
_LINES = 3


def pictures(calibration: Calibration) -> dict[str, str]:
    """Name -> data URI of an SVG, of the base's stops.

    Raises:
        InputError: matplotlib is not installed.
    """
    surface = calibration.surfaces[0]
    with house_style() as figure:
        drawn = {
            "force": _force(figure(_WIDE, layout="constrained"), surface),
            "distance": _distance(figure(_WIDE, layout="constrained"), surface),
            "excess": _excess(figure(_WIDE, layout="constrained"), surface),
            "stop": _stop(figure(_WIDE, layout="constrained"), calibration, surface),
        }
        return {name: svg_uri(picture) for name, picture in drawn.items()}


def _arrays(records: tuple[StopRecord, ...]) -> tuple[Any, Any, Any, Any]:
    return (
        np.array([r.onset_speed for r in records]),
        np.rad2deg([r.grade for r in records]),
        np.array([r.force_ratio for r in records]),
        np.array([r.kept for r in records], bool),
    )


def _force(figure: Any, surface: SurfaceFit) -> Any:
    axes = figure.add_subplot()
    speed, grade, force, kept = _arrays(surface.records)
    dots = axes.scatter(grade[kept], force[kept], c=speed[kept], s=18, cmap="viridis", zorder=3)
    figure.colorbar(dots, ax=axes, label="speed at onset, m/s")
    if not kept.all():
        axes.scatter(grade[~kept], force[~kept], marker="x", c=SECOND, s=26, label="left out")
    theta = np.linspace(*surface.grade_range, 50)
    for v in np.linspace(*surface.speed_range, _LINES):
        colour = dots.cmap(dots.norm(v))
        middle = surface.fit.force_ratio(v, theta)
        std = surface.fit.force_std(np.full_like(theta, v), theta)
        axes.plot(np.rad2deg(theta), middle, color=colour, label=f"model at {v:.1f} m/s")
        axes.fill_between(
            np.rad2deg(theta), middle - 2 * std, middle + 2 * std, color=colour, alpha=0.15, lw=0
        )
    axes.set(xlabel="grade of the ground, °", ylabel="braking force over weight, F_b/W")
    axes.legend(fontsize=8.5)
    return figure


def _distance(figure: Any, surface: SurfaceFit) -> Any:
    axes = figure.add_subplot()
    number = np.arange(1, len(surface.records) + 1)
    actual = np.array([r.samples.distance for r in surface.records])
    bound = np.array([r.bound_distance for r in surface.records])
    bound[~np.isfinite(bound)] = np.nan
    axes.vlines(number, actual, bound, color=FAINT, lw=0.7)
    axes.plot(number, bound, "^", ms=4, color=SECOND, label="allowed for at the quantile")
    axes.plot(number, actual, "o", ms=3.2, color=FIRST, label="actual")
    short = bound < actual
    if short.any():
        axes.plot(number[short], actual[short], "o", ms=9, mfc="none", color="#a82a0c")
    axes.set(xlabel="stop", ylabel="stopping distance, m", ylim=(0.0, None))
    axes.legend(fontsize=8.5)
    return figure


def _excess(figure: Any, surface: SurfaceFit) -> Any:
    axes = figure.add_subplot()
    speed, *_ = _arrays(surface.records)
    excess = np.array([r.bound_distance - r.samples.distance for r in surface.records])
    excess[~np.isfinite(excess)] = np.nan
    axes.axhline(0.0, color="#a82a0c", lw=1.0)
    axes.scatter(speed, excess, s=16, color=FIRST, zorder=3)
    axes.set(xlabel="speed at onset, m/s", ylabel="predicted minus actual, m")
    return figure


def _stop(figure: Any, calibration: Calibration, surface: SurfaceFit) -> Any:
    """The stop in the middle of all by force: neither the best nor the worst of them."""
    axes = figure.add_subplot()
    kept = sorted((r for r in surface.records if r.kept), key=lambda r: r.force_ratio)
    record = kept[len(kept) // 2]
    s, knee = record.samples, record.knee
    axes.plot(s.time, s.speed, ".-", ms=3, lw=0.6, color=FIRST, label="measured")
    deceleration = GRAVITY * (knee.force_ratio + np.sin(knee.mean_grade))
    rest = knee.onset_time + knee.onset_speed / max(deceleration, 1e-3)
    axes.plot(
        [s.time[0], knee.onset_time, rest],
        [knee.onset_speed, knee.onset_speed, 0.0],
        color=SECOND,
        lw=1.4,
        label=f"held speed, onset, F_b/W = {knee.force_ratio:.3f}",
    )
    axes.axvline(0.0, color=INK, lw=0.8, ls=":")
    axes.axvspan(0.0, calibration.dead_time.value, color=FAINT, alpha=0.18, lw=0)
    axes.annotate("dead time", (0.0, 0.02), xycoords=("data", "axes fraction"), fontsize=8.5)
    axes.set(xlabel="time since the stop command, s", ylabel="speed, m/s")
    axes.legend(fontsize=8.5)
    return figure
