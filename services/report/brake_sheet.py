"""Brake sheet: one page of what the brakes of a model can do, as PDF or HTML that prints on A4.

Drawn once; a PDF contains it as text, an HTML page as a picture.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.services.io.files import fault, write_atomic
from slopewise.services.jobs.calibrate import CalibrateResult
from slopewise.services.jobs.calibration_summary import surface_summary
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.plural import plural
from slopewise.services.jobs.provenance import calibration_digests
from slopewise.services.report.brake_numbers import BrakeNumbers, SteepestSlope
from slopewise.services.report.figures import (
    COLOURS,
    FAINT,
    SECOND,
    SHORT,
    figure_style,
    pdf_bytes,
    svg_uri,
)
from slopewise.services.report.page import render

_ENDINGS = (".html", ".pdf")
_SIZE = (8.27, 11.69)
"""A4, upright [inch]."""
_LEFT, _RIGHT, _MIDDLE, _LINE = 0.07, 0.93, 0.51, 0.0152
"""Margins, second column and height of a line, shares of the page."""
_SOFT = "#4d5358"
_MAX_SURFACES, _NAME_LENGTH = 2, 14
"""Other surfaces on the sheet, and letters of their names."""


def check_name(path: Path) -> None:
    """Raise InputError unless the name ends in .html or .pdf."""
    if path.suffix.lower() not in _ENDINGS:
        message = f"expected a name that ends in .html or .pdf, got {path.suffix or 'no ending'}"
        raise fault(path, "", message)


def write_calibration_sheet(
    path: Path,
    result: CalibrateResult,
    logs: LogInput,
    prior: str,
    out: Path | None,
    *,
    quantile: float,
) -> dict[str, Any]:
    """Write the sheet of a calibrated model; returns its numbers.

    The prior, and the calibrated model if it was written, are named by their files.
    """
    numbers = BrakeNumbers(result.model, Uncertainty(quantile=quantile))
    base = surface_summary(result.calibration.surfaces[0])
    promise = base.promise
    facts = {
        "stops learned from": f"{base.stops - base.left_out} of {base.stops}, "
        f"{plural(promise.sessions, 'session')}",
        "counted, here and on new days": f"{promise.counted_here:.1%}, {promise.counted_new:.1%}",
        "held-out sessions, beyond": f"{promise.held_out_beyond} of {promise.held_out}",
    }
    trace = "\n".join(calibration_digests(logs, prior, result.model, out))
    write_sheet(path, numbers, facts, trace, result.calibration.objections)
    return sheet_json(numbers)


def write_sheet(
    path: Path,
    numbers: BrakeNumbers,
    facts: Mapping[str, str],
    trace: str,
    objections: Sequence[str] = (),
) -> None:
    """Write the sheet of one surface, all or nothing: .html or .pdf; objections on top.

    Facts are results from the stops; the trace has lines with the files it was made from.
    """
    check_name(path)
    title = f"Brake sheet of {numbers.model.name}"
    with figure_style() as make_figure:
        figure = make_figure(_SIZE)
        _draw(figure, numbers, title, facts, trace)
        _draw_objections(figure, objections)
        if path.suffix.lower() == ".pdf":
            write_atomic(path, pdf_bytes(figure, title))
            return
        values = {"sheet": svg_uri(figure), "title": title, "warning": unsafe_rule_warning(numbers)}
    page = render("brake_sheet.html", values, title=title, styles=("page.css",))
    write_atomic(path, page.encode("utf-8", "replace"))


def sheet_json(numbers: BrakeNumbers) -> dict[str, Any]:
    """Numbers of the sheet, SI units; null where a stop does not end."""
    table = numbers.sheet_table
    top = float(table.speeds[-1])
    slopes = {
        f"{name}_{direction}": {"claimed": slope.claimed, "law": slope.law}
        for name, steepest in (("holds", numbers.holds), ("stops", numbers.stops))
        for direction, slope in (("uphill", steepest(1.0)), ("downhill", steepest(-1.0)))
    }
    return {
        "quantile": numbers.survive.quantile,
        "brake_ratio": {
            name: {"mean": numbers.mean_force(v, 0.0), "least": numbers.least_force(v, 0.0)}
            for name, v in (("at_rest", 0.0), ("at_top_speed", top))
        },
        "slopes": slopes,
        "least_rear_load": numbers.least_rear_load(),
        "speeds": table.speeds.tolist(),
        "grades": table.grades.tolist(),
        "mean_distance": _finite(table.mean),
        "allowed_distance": _finite(table.allowed),
        "plain_distance": table.plain.tolist(),
        "rule_distance": table.rule.tolist(),
    }


def _finite(distances: Any) -> list[list[float | None]]:
    return [[float(d) if np.isfinite(d) else None for d in row] for row in distances]


def unsafe_rule_warning(numbers: BrakeNumbers) -> str:
    """Sentence on where rules without slope give too short a stop."""
    table = numbers.sheet_table
    top, descent = float(table.speeds[-1]), float(table.grades[0])
    needed = float(table.allowed[-1, 0]) - numbers.offset
    if descent >= 0.0 or needed <= table.rule[-1]:
        return "On the trained grades no stop is longer than RSS gives."
    outcome = "does not end" if math.isinf(needed) else f"takes {needed:.2f} m"
    return (
        f"On {_degrees(descent)} a stop from {top:.2f} m/s {outcome} before any safety offset; RSS "
        f"gives {table.rule[-1]:.2f} m, v²/2a gives {table.plain[-1]:.2f} m: both are unsafe there."
    )


def brake_rows(numbers: BrakeNumbers) -> dict[str, str]:
    """Brakes on level ground: name -> value."""
    model, top = numbers.model, float(numbers.sheet_table.speeds[-1])
    b = numbers.table

    def ratio(speed: float) -> str:
        mean, lower = numbers.mean_force(speed, 0.0), numbers.least_force(speed, 0.0)
        return f"{mean:.3f} mean, {lower:.3f} at the quantile"

    return {
        "vehicle": f"{model.vehicle.mass:.0f} kg, wheelbase {model.vehicle.wheelbase:.2f} m",
        "F_b/W level, at rest": ratio(0.0),
        f"F_b/W level, {top:.2f} m/s": ratio(top),
        "level deceleration": f"{numbers.level_deceleration(top):.2f} m/s² at the quantile",
        "dead time": f"{b.dead_time:.3f} s mean, {numbers.dead_time:.3f} s at the quantile",
        "safety offset": f"{numbers.offset:.3f} m in each distance",
        "speeds are driven to": f"± {b.speed_error:.3f} m/s" if b.speed_error > 0 else "not known",
        "effects": ", ".join(e.name.replace("_", " ") for e in model.effect) or "none",
        "surface": numbers.surface or "base",
        **_other_surfaces(numbers, top),
    }


def _other_surfaces(numbers: BrakeNumbers, speed: float) -> dict[str, str]:
    """Longest stops of the sheet on other surfaces of the model, the longest first."""
    b = numbers.model.braking
    surfaces = {n for n, table in b.terrain.items() if table.state_of is None} - {numbers.surface}
    longest = {
        n: replace(numbers, surface=n).allowed_distance(
            min(speed, b.on(n).speed_range[1]), b.grade_range[0]
        )
        for n in surfaces
    }
    listed = sorted(longest, key=lambda n: (-longest[n], n))[:_MAX_SURFACES]
    texts = (
        f"{name[:_NAME_LENGTH]} {_metres(longest[name])}{' m' if longest[name] < math.inf else ''}"
        for name in listed
    )
    return {"longest stop on others": ", ".join(texts)} if listed else {}


def slope_rows(numbers: BrakeNumbers) -> dict[str, str]:
    """Brakes on slopes, and the ranges of the training: name -> value."""
    b = numbers.table
    slow, fast = b.speed_range
    low, high = b.grade_range

    def format_slopes(uphill: SteepestSlope, downhill: SteepestSlope) -> str:
        return ", ".join(
            f"{np.rad2deg(slope.claimed):.1f}°{'+' if slope.law > slope.claimed else ''}"
            for slope in (uphill, downhill)
        )

    load, min_load = numbers.least_rear_load(), numbers.model.limits.min_load
    return {
        "stops uphill, downhill": format_slopes(numbers.stops(1.0), numbers.stops(-1.0)),
        "holds uphill, downhill": format_slopes(numbers.holds(1.0), numbers.holds(-1.0)),
        "rear axle, steepest stop": f"{load:.0%} of level, {min_load:.0%} required",
        "trained speeds": f"{slow:.2f} … {fast:.2f} m/s",
        "trained grades": f"{_degrees(low)} … {_degrees(high)}",
        "+": "training ends there, the law does not",
    }


def _degrees(grade: float) -> str:
    return f"{np.rad2deg(grade):.1f}°".replace("-", "−")


def _metres(distance: float) -> str:
    return f"{distance:.2f}" if math.isfinite(distance) else "–"


def _draw(
    figure: Any, numbers: BrakeNumbers, title: str, facts: Mapping[str, str], trace: str
) -> None:
    quantile = f"quantile {numbers.survive.quantile:g}"
    figure.text(_LEFT, 0.957, title, fontsize=18, weight="bold")
    figure.text(
        _LEFT,
        0.947,
        f"Stops on uniform grades: mean of the model, and what plans reserve at the {quantile}.\n"
        "The drive held or cut through the dead time, the longer of both.",
        fontsize=8.5,
        va="top",
        color=_SOFT,
    )
    _draw_rows(figure, _LEFT, "Brakes", brake_rows(numbers))
    _draw_rows(figure, _MIDDLE, "Slopes and evidence", {**slope_rows(numbers), **facts})
    head = f"Stopping distance, m: at the {quantile} with offset / mean"
    figure.text(_LEFT, 0.727, head, fontsize=10.5, weight="bold")
    y = _draw_distances(figure, 0.714, numbers) - 1.7 * _LINE
    figure.text(_LEFT, y, "Compared with rules without slope", fontsize=10.5, weight="bold")
    warning = unsafe_rule_warning(numbers)
    figure.text(_LEFT, y - 0.009, warning, fontsize=7.8, va="top", color=SHORT)
    low = 0.225
    _draw_chart(figure.add_axes((0.115, low, _RIGHT - 0.115, y - 0.035 - low)), numbers)
    figure.text(_LEFT, 0.175, "Traceability", fontsize=10.5, weight="bold")
    figure.text(_LEFT, 0.167, trace, fontsize=6.1, va="top", family="monospace", linespacing=1.35)


def _draw_objections(figure: Any, objections: Sequence[str]) -> None:
    """Every objection, in the margin above the title."""
    lines = [text for each in objections for text in textwrap.wrap(f"Rejected: {each}", 118)]
    if lines:
        figure.text(
            _LEFT, 0.994, "\n".join(lines), fontsize=7.5, va="top", color=SHORT, weight="bold"
        )


def _draw_rows(figure: Any, x: float, head: str, rows: Mapping[str, str]) -> None:
    top = 0.905
    figure.text(x, top, head, fontsize=10.5, weight="bold")
    for number, (name, value) in enumerate(rows.items(), start=1):
        figure.text(x, top - 0.003 - _LINE * number, name, fontsize=8, color=_SOFT)
        figure.text(x + 0.17, top - 0.003 - _LINE * number, value, fontsize=8)


def _draw_distances(figure: Any, y: float, numbers: BrakeNumbers) -> float:
    """Draw the table of distances; returns where it ends."""
    from matplotlib.lines import Line2D

    table = numbers.sheet_table
    step = (_RIGHT - _LEFT - 0.075) / len(table.grades)
    columns = _LEFT + 0.075 + step * (np.arange(len(table.grades)) + 1.0)
    y -= 0.8 * _LINE
    figure.text(_LEFT, y, "v, m/s", fontsize=8, color=_SOFT)
    for x, grade in zip(columns, table.grades, strict=True):
        figure.text(x, y, _degrees(grade), fontsize=8, ha="right", color=_SOFT)
    for speed, allowed, mean in zip(table.speeds, table.allowed, table.mean, strict=True):
        y -= _LINE
        figure.text(_LEFT, y, f"{speed:.2f}", fontsize=8)
        for x, longer, shorter in zip(columns, allowed, mean, strict=True):
            cell = f"{_metres(longer)} / {_metres(shorter)}"
            figure.text(x, y, cell, fontsize=8, ha="right")
        ruled = [y + 0.72 * _LINE] * 2
        line = Line2D([_LEFT, _RIGHT], ruled, lw=0.4, color=FAINT, transform=figure.transFigure)
        figure.add_artist(line)
    return y


def _draw_chart(axes: Any, numbers: BrakeNumbers) -> None:
    """Stops without offset over the grade; filled where a rule is shorter."""
    table = numbers.sheet_table
    grades = np.linspace(table.grades[0], table.grades[-1], 25)
    count = len(table.speeds)
    for colour, i in zip(COLOURS[::3], sorted({count - 1, count // 2, 0}), strict=False):
        speed, rule = float(table.speeds[i]), table.rule[i]
        needed = np.array([numbers.allowed_distance(speed, float(g)) for g in grades])
        needed = np.where(np.isfinite(needed), needed - numbers.offset, np.nan)
        x = np.rad2deg(grades)
        axes.plot(x, needed, color=colour, label=f"{speed:.2f} m/s")
        axes.axhline(rule, color=colour, lw=0.9, ls="--")
        axes.fill_between(x, rule, needed, where=needed > rule, color=SECOND, alpha=0.18, lw=0)
    axes.set(xlabel="grade, ° (uphill positive)", ylabel="stop at the quantile, m", ylim=(0, None))
    axes.legend(fontsize=7.5, title="without offset; dashed: RSS, v ρ + v²/2b", title_fontsize=7.5)
