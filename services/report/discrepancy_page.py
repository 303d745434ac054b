"""The page of `slopewise discrepancy`: missing effects, confidence, and the change in metres."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.discrepancy.findings import (
    AxisResidual,
    Evidence,
    Findings,
    Gap,
    LocatedAxis,
    NamedEffect,
    Verdict,
)
from slopewise.models.discrepancy.report.text import answers, closed_text, confidence_text
from slopewise.models.effects.registry import LAWS
from slopewise.services.jobs.plural import plural
from slopewise.services.report.figures import FAINT, FIRST, INK, SECOND, draw_figures
from slopewise.services.report.page import write_page

VERDICT_LABELS = {
    Verdict.NONE: ("nothing missing", "fine"),
    Verdict.PARAMETER_DRIFT: ("parameter drift", "fine"),
    Verdict.MISSING_EFFECT: ("missing effect", "missing"),
    Verdict.AMBIGUOUS: ("ambiguous", "unclear"),
    Verdict.UNIDENTIFIABLE: ("unidentifiable", "unclear"),
    Verdict.UNKNOWN: ("unknown effect", "unclear"),
    Verdict.TOO_NOISY: ("too noisy", "unclear"),
}
"""Label of each verdict, and its style."""

_CONFIDENT = 0.9  # from which a name stands without a word on what it may be instead [1]
STYLES = ("page.css", "calibration.css", "discrepancy.css")
_AXES = 6
"""Axes of the residual that are drawn."""
_BINS, _MIN_BIN = 8, 3
"""Bins of a mean along an axis, and values below which a bin has none."""


def write_discrepancy_page(
    path: Path, findings: Findings, *, title: str, provenance: Mapping[str, str]
) -> None:
    """Write the page, all or nothing; provenance: logs, model, date: name -> value."""
    label, kind = VERDICT_LABELS[findings.verdict]
    distance = findings.stop_distance
    values = {
        "title": title,
        "label": label,
        "kind": kind,
        "verdict": findings.summary,
        "answers": answers(findings),
        "facts": {
            "by": f"slopewise {metadata.version('slopewise')} from "
            f"{plural(findings.stops, 'stop')}",
            "stopping distance": f"{distance.before:.2f} m off before, "
            f"{distance.after:.2f} m after (rms)",
            "safety offset now": f"{findings.model.braking.distance_offset:.2f} m",
            **provenance,
        },
        "notices": findings.notes,
        "effects": [
            (effect.name, LAWS[effect.name].missing, *effect_cells(effect)[1:])
            for effect in findings.effects
        ],
        "closed": _closed(findings.gap),
        "located": [_axis_cells(axis) for axis in findings.located] or [("no axis", "", "", "")],
        "pictures": _figures(findings),
    }
    write_page(path, "discrepancy.html", values, "discrepancy", STYLES)


def _closed(gap: Gap) -> str:
    if gap.closed is None or gap.ci95 is None:
        return "The gap is too near its floor for a percentage."
    return f"Of the closable gap {closed_text(gap)}."


def effect_cells(effect: NamedEffect) -> tuple[str, str, str, str, str]:
    """Name, parameters, confidence, what it may be instead, and where.

    Where no alternative explains the log nearly as well, all other effects have the remainder,
    instead of it or next to it.
    """
    parameters = ", ".join(
        f"{name} = {p.value:.4g} ± {p.std:.2g} {p.unit if p.unit != '1' else ''}".rstrip()
        for name, p in effect.parameters.items()
    )
    remainder = (
        f"another or a further one: {1.0 - effect.confidence:.0%}"
        if effect.confidence < _CONFIDENT
        else "–"
    )
    alternatives = ", ".join(effect.alternatives) or remainder
    return effect.name, parameters, confidence_text(effect.confidence), alternatives, effect.where


def _axis_cells(axis: LocatedAxis) -> tuple[str, ...]:
    factor, unit = _shown_unit(axis.unit)
    span = f"{factor * axis.low:.3g} … {factor * axis.high:.3g} {unit}".rstrip()
    chance = "< 0.001" if axis.p_value < 1e-3 else f"{axis.p_value:.3f}"
    return axis.axis.replace("_", " "), span, f"{axis.share_of_gap:.0%}", chance


def _shown_unit(unit: str) -> tuple[float, str]:
    """Factor to the unit that the page shows, and that unit: degrees, and none for shares."""
    if unit in ("rad", "rad/s"):
        return float(np.rad2deg(1.0)), unit.replace("rad", "°")
    return 1.0, "" if unit == "1" else unit


def _figures(findings: Findings) -> dict[str, str]:
    """Data URI of each figure; ``map`` is empty where the log has no positions."""
    evidence, wide = findings.evidence, (7.4, 4.0)
    drawings: dict[str, Any] = {
        "gap": ((7.4, 2.6), lambda figure: _draw_gaps(figure, findings)),
        "stop": (wide, lambda figure: _draw_stop(figure, evidence)),
        "distance": (wide, lambda figure: _draw_distance(figure, evidence)),
        "axes": ((11.0, 6.2), lambda figure: _draw_axes(figure, evidence)),
    }
    if evidence.x is not None and evidence.y is not None:
        drawings["map"] = ((11.0, 4.4), lambda figure: _draw_map(figure, evidence))
    return {"map": "", **draw_figures(**drawings)}


def _draw_gaps(figure: Any, findings: Findings) -> None:
    for i, gap in enumerate((findings.gap, findings.stop_distance)):
        _draw_gap(figure.add_subplot(1, 2, i + 1), gap)


def _draw_gap(axes: Any, gap: Gap) -> None:
    values = (gap.before, gap.refit, gap.after)
    names = ("as configured", "refitted", "with what\nwas found")
    bars = axes.barh(names, values, color=(SECOND, FAINT, FIRST), height=0.6)  # words: ok (chart)
    axes.bar_label(bars, fmt="%.3f", padding=3, fontsize=9)
    axes.axvline(gap.noise_floor, color=INK, lw=1.0, ls=":")
    axes.annotate(
        "floor",
        (gap.noise_floor, 1.0),
        xycoords=("data", "axes fraction"),
        fontsize=8.5,
        xytext=(3, 2),
        textcoords="offset points",
    )
    axes.invert_yaxis()
    axes.set(xlabel=f"{gap.metric} [{gap.unit}]", xlim=(0.0, 1.18 * max(*values, gap.noise_floor)))
    axes.grid(axis="y", visible=False)


def _draw_stop(figure: Any, evidence: Evidence) -> None:
    axes = figure.add_subplot()
    axes.plot(evidence.time, evidence.speed, ".", ms=6, color=INK, label="measured")
    axes.plot(evidence.time, evidence.speed_before, color=SECOND, lw=1.6, label="as configured")
    if evidence.changed:
        speed = evidence.speed_after
        axes.plot(evidence.time, speed, color=FIRST, lw=1.6, label="with what was found")
    axes.axvline(0.0, color=INK, lw=0.8, ls=":")
    axes.set(xlabel="time since the stop command [s]", ylabel="speed [m/s]", ylim=(0.0, None))
    axes.legend(fontsize=8.5)


def _draw_distance(figure: Any, evidence: Evidence) -> None:
    axes = figure.add_subplot()
    # By the prediction: sorted by the measurement, mere scatter would look like a trend.
    order = np.argsort(evidence.configured)
    number = np.arange(1, len(order) + 1)
    predictions = [(evidence.configured, SECOND, "as configured")]
    if evidence.changed:
        predictions.append((evidence.found, FIRST, "with what was found"))
    for predicted, colour, label in predictions:
        error = predicted[order] - evidence.distance[order]
        axes.plot(number, error, "o", ms=3.4, color=colour, label=label, alpha=0.85)
    axes.axhline(0.0, color=INK, lw=0.8)
    axes.set(
        xlabel="stops, shortest predicted first",
        ylabel="predicted less measured\nstopping distance [m]",
    )
    axes.legend(fontsize=8.5)


def _draw_axes(figure: Any, evidence: Evidence) -> None:
    shown = [a for a in evidence.axes if a.name != "place"][:_AXES]
    for i, axis in enumerate(shown):
        axes = figure.add_subplot(2, (_AXES + 1) // 2, i + 1)
        _draw_residual(axes, axis, evidence)
        if i == 0:
            axes.legend(fontsize=8, loc="best")


def _draw_residual(axes: Any, axis: AxisResidual, evidence: Evidence) -> None:
    scatter = evidence.scatter
    factor, unit = _shown_unit(axis.unit)
    value = factor * axis.value
    axes.axhspan(-scatter, scatter, color=FAINT, alpha=0.22, lw=0)
    axes.axhline(0.0, color=INK, lw=0.8)
    for residual, colour, label in (
        (evidence.before, SECOND, "refitted"),
        (evidence.after, FIRST, "with what was found"),
    ):
        axes.plot(value, residual, ".", ms=1.6, color=colour, alpha=0.25)
        middle, mean, band = _binned_means(value.ravel(), residual.ravel())
        axes.fill_between(middle, mean - band, mean + band, color=colour, alpha=0.25, lw=0)
        axes.plot(middle, mean, color=colour, lw=1.5, label=label)
    low, high = np.nanquantile(evidence.before, [0.02, 0.98])
    reach = max(-low, high, 3.0 * scatter)
    label = axis.name.replace("_", " ") + (f" [{unit}]" if unit else "")
    axes.set(xlabel=label, ylabel="missing force / weight", ylim=(-reach, reach))
    chance = "1 in 1000 or less" if axis.p_value < 1e-3 else f"p = {axis.p_value:.2g}"
    axes.set_title(f"by chance: {chance}", fontsize=9, loc="right")


def _binned_means(value: Any, residual: Any) -> tuple[Any, Any, Any]:
    """Middle, mean and two standard errors of bins with equal numbers of values."""
    finite = np.isfinite(value) & np.isfinite(residual)
    value, residual = value[finite], residual[finite]
    parts = [p for p in np.array_split(np.argsort(value), _BINS) if len(p) >= _MIN_BIN]
    middle = np.array([np.mean(value[p]) for p in parts])
    mean = np.array([np.mean(residual[p]) for p in parts])
    band = np.array([2.0 * np.std(residual[p], ddof=1) / np.sqrt(len(p)) for p in parts])
    return middle, mean, band


def _draw_map(figure: Any, evidence: Evidence) -> None:
    if not evidence.axes:
        return
    before, after = (_row_means(r) for r in (evidence.before, evidence.after))
    reach = max(float(np.nanquantile(np.abs(before), 0.95)), 1e-6)
    for i, (residual, title) in enumerate(((before, "refitted"), (after, "with what was found"))):
        axes = figure.add_subplot(1, 2, i + 1)
        dots = axes.scatter(
            evidence.x,
            evidence.y,
            c=residual,
            s=26,
            cmap="RdBu_r",
            vmin=-reach,
            vmax=reach,
            edgecolors=INK,
            linewidths=0.3,
        )
        axes.set_title(title, fontsize=9.5)
        axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    figure.colorbar(dots, ax=figure.axes, label="missing force / weight", shrink=0.9)


def _row_means(values: Any) -> Any:
    """(S,) means over the finite values of each row, NaN where a row has no finite value."""
    finite = np.isfinite(values)
    count = np.where(finite.any(axis=1), finite.sum(axis=1), np.nan)
    return np.where(finite, values, 0.0).sum(axis=1) / count
