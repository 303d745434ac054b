"""Pages of `slopewise calibrate`: a calibration with its figures, or a log that was rejected.

The figures are those of the papers, remade on the user's stops: Braking, Fig. 2 (one stop with its
onset), Fig. 3 (force over slope and speed) and Fig. 6 (predicted and actual stopping distance).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.calibration.learn import Calibration
from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.stop_logs.find_stops import Usability
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.jobs.calibrate import CalibrateResult, RejectedLogError
from slopewise.services.jobs.calibration_summary import surface_rows
from slopewise.services.jobs.plural import plural
from slopewise.services.report.figures import FAINT, FIRST, INK, SECOND, SHORT, draw_figures
from slopewise.services.report.page import MAX_ROWS, write_page

_MAX_STOPS = 500
"""Stops that the page of a rejected log lists [1]."""
_SPEED_LINES = 3
"""Lines of force over grade in the chart [1]: slow, middle and fast."""


def write_calibration_page(path: Path, result: CalibrateResult, facts: Mapping[str, str]) -> None:
    """Write the page of a calibration, all or nothing; facts: logs, model, date: name -> value."""
    calibration = result.calibration
    values = {
        "title": f"Brakes of {result.model.name}",
        "verdict": _verdict(calibration),
        "facts": {**_shared_facts(calibration), **facts},
        "notices": (*calibration.objections, *calibration.warnings),
        "pictures": _figures(calibration),
        "columns": [("", ""), *((s.name or "base", "number") for s in calibration.surfaces)],
        "rows": [(label, *cells) for label, cells in surface_rows(calibration).items()],
        "stops": [],
        "stop_counts": [(Usability[n.upper()].value, k) for n, k in calibration.verdicts.items()],
        "footer": "Lengths are along the ground. Every number is also in the model file and in the "
        "table of stops, in SI units and radians.",
    }
    _write(path, values, calibration.suspects, result.log)


def write_rejected_log(path: Path, rejected: RejectedLogError, facts: Mapping[str, str]) -> None:
    run, t = rejected.log.columns["run"], rejected.log.columns["t"]
    values = {
        "title": "Brakes that were not learned",
        "verdict": f"Rejected: {rejected}",
        "facts": facts,
        "notices": (),
        "pictures": {},
        "stops": [
            (
                f"{run[w.command]}, {t[w.command]:.2f} s",
                f"{w.held_speed:.2f}",
                w.reason or w.verdict.value,
            )
            for w in rejected.windows[:_MAX_STOPS]
        ],
        "stop_counts": Counter(w.verdict.value for w in rejected.windows).most_common(),
        "footer": "Nothing was learned. Speeds are in m/s, times in seconds on the clock of the "
        "log.",
    }
    _write(path, values, rejected.suspects, rejected.log)


def _write(path: Path, values: dict[str, Any], issues: Sequence[Suspect], log: DriveLog) -> None:
    t = log.columns["t"]
    values |= {
        "issues": [(f"{t[s.start]:.2f} s", s.reason) for s in issues[:MAX_ROWS]],
        "more_issues": len(issues) - MAX_ROWS,
    }
    write_page(path, "calibration.html", values, "calibrate")


def _verdict(calibration: Calibration) -> str:
    base = calibration.surfaces[0]
    margin = np.array([r.distance_margin for r in base.records])
    within, finite = int(np.sum(margin >= 0.0)), margin[np.isfinite(margin)]
    mean = float(np.mean(finite)) if len(finite) else float("inf")
    return (
        f"{within} of {plural(len(base.records), 'stop')} ended within the distance that a plan "
        f"allows, {mean:.2f} m before its end on average. {base.promise.sentence()}."
    )


def _shared_facts(calibration: Calibration) -> dict[str, str]:
    dead, mount, speed_error = calibration.dead_time, calibration.mount, calibration.speed_error
    dive = np.rad2deg(calibration.dive.per_deceleration)
    offset = f"{np.rad2deg(mount.offset):+.2f}° by {mount.source}" if mount.known else "not known"
    return {
        "speeds driven": "not known"
        if speed_error is None
        else f"to ± {speed_error.value:.3f} m/s",
        "dead time": f"{dead.value:.3f} ± {dead.std:.3f} s, jitter {dead.between_stops:.3f} s",
        "brake dive": f"{dive:.2f}° per m/s²",
        "pitch sensor mounted": offset,
    }


def _figures(calibration: Calibration) -> dict[str, str]:
    """Data URI of each figure, of the stops on the base surface."""
    base = calibration.surfaces[0]
    wide = (7.4, 4.2)
    return draw_figures(
        force=(wide, lambda figure: _draw_force(figure, base)),
        distance=(wide, lambda figure: _draw_distance(figure, base)),
        excess=(wide, lambda figure: _draw_margin(figure, base)),
        stop=(wide, lambda figure: _draw_stop(figure, calibration.dead_time.value, base)),
    )


def _draw_force(figure: Any, surface: SurfaceFit) -> None:
    axes = figure.add_subplot()
    speed = np.array([r.onset_speed for r in surface.records])
    grade = np.rad2deg([r.grade for r in surface.records])
    force = np.array([r.force_ratio for r in surface.records])
    inlier = np.array([r.kept for r in surface.records], bool)
    dots = axes.scatter(
        grade[inlier], force[inlier], c=speed[inlier], s=18, cmap="viridis", zorder=3
    )
    figure.colorbar(dots, ax=axes, label="speed at onset, m/s")
    if not inlier.all():
        axes.scatter(grade[~inlier], force[~inlier], marker="x", c=SECOND, s=26, label="excluded")
    theta = np.linspace(*surface.grade_range, 50)
    for v in np.linspace(*surface.speed_range, _SPEED_LINES):
        colour = dots.cmap(dots.norm(v))
        middle = surface.fit.force_ratio(v, theta)
        band = 2 * surface.fit.force_std(np.full_like(theta, v), theta)
        axes.plot(np.rad2deg(theta), middle, color=colour, label=f"model at {v:.1f} m/s")
        axes.fill_between(
            np.rad2deg(theta), middle - band, middle + band, color=colour, alpha=0.15, lw=0
        )
    axes.set(xlabel="grade of the ground, °", ylabel="braking force over weight, F_b/W")
    axes.legend(fontsize=8.5)


def _draw_distance(figure: Any, surface: SurfaceFit) -> None:
    axes = figure.add_subplot()
    number = np.arange(1, len(surface.records) + 1)
    actual = np.array([r.samples.distance for r in surface.records])
    allowed = np.array([r.bound_distance for r in surface.records])
    allowed[~np.isfinite(allowed)] = np.nan
    axes.vlines(number, actual, allowed, color=FAINT, lw=0.7)
    predicted = np.array([r.predicted_distance for r in surface.records])
    predicted[~np.isfinite(predicted)] = np.nan
    axes.plot(
        number, allowed, "^", ms=4, color=SECOND, label=f"allowed at {surface.promise.share:g}"
    )
    axes.plot(number, predicted, "_", ms=7, color=INK, label="predicted without this stop")
    axes.plot(number, actual, "o", ms=3.2, color=FIRST, label="actual")
    exceeded = allowed < actual
    if exceeded.any():
        axes.plot(number[exceeded], actual[exceeded], "o", ms=9, mfc="none", color=SHORT)
    top = 1.15 * float(np.nanmax([actual, allowed]))
    axes.set(xlabel="stop", ylabel="stopping distance, m", ylim=(0.0, top))
    axes.legend(fontsize=8.5, loc="upper left", ncols=3)


def _draw_margin(figure: Any, surface: SurfaceFit) -> None:
    axes = figure.add_subplot()
    margin = np.array([r.distance_margin for r in surface.records])
    margin[~np.isfinite(margin)] = np.nan
    axes.axhline(0.0, color=SHORT, lw=1.0)
    axes.scatter([r.onset_speed for r in surface.records], margin, s=16, color=FIRST, zorder=3)
    axes.set(xlabel="speed at onset, m/s", ylabel="allowed minus actual, m")


def _draw_stop(figure: Any, dead_time: float, surface: SurfaceFit) -> None:
    """The median stop by force: neither the best nor the worst of them."""
    axes = figure.add_subplot()
    inliers = sorted((r for r in surface.records if r.kept), key=lambda r: r.force_ratio)
    record = inliers[len(inliers) // 2]
    s, knee = record.samples, record.knee
    axes.plot(s.time, s.speed, ".-", ms=3, lw=0.6, color=FIRST, label="measured")
    deceleration = GRAVITY * (knee.force_ratio + np.sin(knee.mean_grade))
    standstill = knee.onset_time + knee.onset_speed / max(deceleration, 1e-3)
    axes.plot(
        [s.time[0], knee.onset_time, standstill],
        [knee.onset_speed, knee.onset_speed, 0.0],
        color=SECOND,
        lw=1.4,
        label=f"held speed, onset, F_b/W = {knee.force_ratio:.3f}",
    )
    axes.axvline(0.0, color=INK, lw=0.8, ls=":")
    axes.axvspan(0.0, dead_time, color=FAINT, alpha=0.18, lw=0)
    axes.annotate("dead time", (0.0, 0.02), xycoords=("data", "axes fraction"), fontsize=8.5)
    axes.set(xlabel="time since the stop command, s", ylabel="speed, m/s")
    axes.legend(fontsize=8.5)
