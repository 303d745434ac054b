"""Pictures of a discrepancy as SVG: gap, one stop, residuals along axes and on the map."""

from __future__ import annotations

from typing import Any

import numpy as np

from slopewise.models.discrepancy.findings import Findings, Gap
from slopewise.models.discrepancy.report.evidence import AxisResidual, Evidence
from slopewise.services.report.figures import FAINT, FIRST, INK, SECOND, house_style, svg_uri

_WIDE = (7.4, 4.0)
_AXES = 6
_BINS = 8
_ENOUGH = 3  # values that a mean in a bin takes
_DEGREES = ("rad", "rad/s")


def pictures(findings: Findings, evidence: Evidence) -> dict[str, str]:
    """Name -> data URI of an SVG; `map` is missing where the log has no places.

    Raises:
        InputError: matplotlib is not installed.
    """
    with house_style() as figure:
        drawn = {
            "gap": _gap(figure((7.4, 2.6), layout="constrained"), findings),
            "stop": _stop(figure(_WIDE, layout="constrained"), evidence),
            "distance": _distance(figure(_WIDE, layout="constrained"), evidence),
            "axes": _axes(figure((11.0, 6.2), layout="constrained"), evidence),
        }
        if evidence.x is not None and evidence.y is not None:
            drawn["map"] = _map(figure((11.0, 4.4), layout="constrained"), evidence)
        return {name: svg_uri(picture) for name, picture in drawn.items()}


def _gap(figure: Any, findings: Findings) -> Any:
    for i, gap in enumerate((findings.gap, findings.stop_distance)):
        axes = figure.add_subplot(1, 2, i + 1)
        _bars(axes, gap)
    return figure


def _bars(axes: Any, gap: Gap) -> None:
    values = (gap.before, gap.refit, gap.after)
    names = ("as configured", "refitted", "with what\nwas found")
    bars = axes.barh(names, values, color=(SECOND, FAINT, FIRST), height=0.6)
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


def _stop(figure: Any, evidence: Evidence) -> Any:
    axes = figure.add_subplot()
    axes.plot(evidence.time, evidence.speed, ".", ms=6, color=INK, label="measured")
    axes.plot(evidence.time, evidence.speed_before, color=SECOND, lw=1.6, label="as configured")
    if evidence.changed:
        found = evidence.speed_after
        axes.plot(evidence.time, found, color=FIRST, lw=1.6, label="with what was found")
    axes.axvline(0.0, color=INK, lw=0.8, ls=":")
    axes.set(xlabel="time since the stop command [s]", ylabel="speed [m/s]", ylim=(0.0, None))
    axes.legend(fontsize=8.5)
    return figure


def _distance(figure: Any, evidence: Evidence) -> Any:
    axes = figure.add_subplot()
    # By what was predicted: sorted by what was measured, mere scatter would look like a trend.
    order = np.argsort(evidence.configured)
    number = np.arange(1, len(order) + 1)
    ways = [(evidence.configured, SECOND, "as configured")]
    if evidence.changed:
        ways.append((evidence.found, FIRST, "with what was found"))
    for way, colour, label in ways:
        off = way[order] - evidence.distance[order]
        axes.plot(number, off, "o", ms=3.4, color=colour, label=label, alpha=0.85)
    axes.axhline(0.0, color=INK, lw=0.8)
    axes.set(
        xlabel="stops, shortest predicted first",
        ylabel="predicted less measured\nstopping distance [m]",
    )
    axes.legend(fontsize=8.5)
    return figure


def _axes(figure: Any, evidence: Evidence) -> Any:
    shown = [a for a in evidence.axes if a.name != "place"][:_AXES]
    for i, axis in enumerate(shown):
        axes = figure.add_subplot(2, (_AXES + 1) // 2, i + 1)
        _residual(axes, axis, evidence.scatter)
        if i == 0:
            axes.legend(fontsize=8, loc="best")
    return figure


def _residual(axes: Any, axis: AxisResidual, scatter: float) -> None:
    in_degrees = axis.unit in _DEGREES
    value = np.rad2deg(axis.value) if in_degrees else axis.value
    unit = axis.unit.replace("rad", "°") if in_degrees else axis.unit
    axes.axhspan(-scatter, scatter, color=FAINT, alpha=0.22, lw=0)
    axes.axhline(0.0, color=INK, lw=0.8)
    for off, colour, label in (
        (axis.before, SECOND, "refitted"),
        (axis.after, FIRST, "with what was found"),
    ):
        axes.plot(value, off, ".", ms=1.6, color=colour, alpha=0.25)
        middle, mean, band = _means(value.ravel(), off.ravel())
        axes.fill_between(middle, mean - band, mean + band, color=colour, alpha=0.25, lw=0)
        axes.plot(middle, mean, color=colour, lw=1.5, label=label)
    low, high = np.nanquantile(axis.before, [0.02, 0.98])
    reach = max(-low, high, 3.0 * scatter)
    label = axis.name.replace("_", " ") + (f" [{unit}]" if unit and unit != "1" else "")
    axes.set(xlabel=label, ylabel="missing force / weight", ylim=(-reach, reach))
    axes.set_title(_chance(axis.p_value), fontsize=9, loc="right")


def _chance(p_value: float) -> str:
    return "by chance: 1 in 1000 or less" if p_value < 1e-3 else f"by chance: p = {p_value:.2g}"


def _means(value: Any, off: Any) -> tuple[Any, Any, Any]:
    """Mean and two standard errors in bins of equally many values."""
    good = np.isfinite(value) & np.isfinite(off)
    value, off = value[good], off[good]
    parts = [p for p in np.array_split(np.argsort(value), _BINS) if len(p) >= _ENOUGH]
    middle = np.array([np.mean(value[p]) for p in parts])
    mean = np.array([np.mean(off[p]) for p in parts])
    band = np.array([2.0 * np.std(off[p], ddof=1) / np.sqrt(len(p)) for p in parts])
    return middle, mean, band


def _mean_of_rows(values: Any) -> Any:
    """(S,) means of what is known, NaN where nothing is."""
    known = np.isfinite(values)
    count = np.where(known.any(axis=1), known.sum(axis=1), np.nan)
    return np.where(known, values, 0.0).sum(axis=1) / count


def _map(figure: Any, evidence: Evidence) -> Any:
    if not evidence.axes:
        return figure
    before = _mean_of_rows(evidence.axes[0].before)
    after = _mean_of_rows(evidence.axes[0].after)
    reach = max(float(np.nanquantile(np.abs(before), 0.95)), 1e-6)
    for i, (off, title) in enumerate(((before, "refitted"), (after, "with what was found"))):
        axes = figure.add_subplot(1, 2, i + 1)
        dots = axes.scatter(
            evidence.x,
            evidence.y,
            c=off,
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
    return figure
