"""What a calibration says of one surface: the rows of its tables, and the same as JSON."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from slopewise.models.calibration.brake_states import WeakerState
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.speed_error import SpeedError
from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.services.report.plan_labels import plural


def coverage(surface: SurfaceFit) -> tuple[float, float]:
    """Share of its stops that end within the prediction, and by how much on average [m].

    Of all stops that were measured: each prediction is by a fit that has not seen the stop, at the
    quantile of the margins; stops that the fit left out count, too. Endless predictions have no
    excess.
    """
    excess = np.array([r.bound_distance - r.samples.distance for r in surface.records])
    finite = excess[np.isfinite(excess)]
    return float(np.mean(excess >= 0.0)), float(np.mean(finite)) if len(finite) else 0.0


def surface_json(s: SurfaceFit) -> dict[str, Any]:
    """Everything for machines, SI units and radians."""
    std = np.sqrt(np.diag(s.fit.covariance))
    covered, excess = coverage(s)
    return {
        "name": s.name,
        "stops": len(s.records),
        "left_out": sum(not r.kept for r in s.records),
        "coefficients": {
            name: {"value": float(v), "std": float(e), "learned": float(share)}
            for name, v, e, share in zip(NAMES, s.fit.coefficients, std, s.fit.learned, strict=True)
        },
        "covariance": s.fit.covariance.tolist(),
        "scatter": s.fit.scatter,
        "force_std": s.margins.force.absolute,
        "force_scatter": s.margins.force.relative,
        "dead_time_std": s.margins.dead_time,
        "state": _state_json(s.state),
        "two_stages": None if s.two_stages is None else s.two_stages.tolist(),
        "distance_offset": s.distance_offset,
        "time_offset": s.time_offset,
        "speed_range": list(s.speed_range),
        "grade_range": list(s.grade_range),
        "coverage": covered,
        "mean_excess": excess,
    }


def _state_json(state: WeakerState | None) -> dict[str, float] | None:
    if state is None:
        return None
    return {
        "stops": int(state.members.sum()),
        "ratio": state.ratio,
        "ratio_std": state.ratio_std,
        "force_scatter": state.scatter,
    }


def _scatter(s: SurfaceFit) -> str:
    force = s.margins.force
    return f"{force.relative:.1%} of it" if force.relative > 0.0 else f"{force.absolute:.4f}"


def _state(s: SurfaceFit) -> str:
    if s.state is None:
        return "–"
    return f"{s.state.ratio:.0%} ({plural(int(s.state.members.sum()), 'stop')})"


def speed_words(found: SpeedError | None) -> str:
    """How well speeds are driven, in a line."""
    if found is None:
        return "speed error kept as it was: the log has too little driving at one command"
    return (
        f"speeds are driven to ± {found.value:.3f} m/s, {found.bias:+.3f} m/s from the command "
        f"({plural(found.stretches, 'stretch')}, {found.seconds:.0f} s)"
    )


def _coefficient(index: int) -> Callable[[SurfaceFit], str]:
    def cell(s: SurfaceFit) -> str:
        std = float(np.sqrt(s.fit.covariance[index, index]))
        return f"{s.fit.coefficients[index]:+.4f} ± {std:.4f}"

    return cell


def _grades(s: SurfaceFit) -> str:
    low, high = np.rad2deg(s.grade_range)
    return f"{low:.1f}° … {high:.1f}°"


ROWS: dict[str, Callable[[SurfaceFit], str]] = {
    "m_m, s/m": _coefficient(0),
    "b_m": _coefficient(1),
    "m_b, s/m": _coefficient(2),
    "b_b": _coefficient(3),
    "stops learned from": lambda s: f"{sum(r.kept for r in s.records)} of {len(s.records)}",
    "force scatters by": _scatter,
    "dead time by, s": lambda s: f"{s.margins.dead_time:.4f}",
    "force of a weaker state": _state,
    "distance offset, m": lambda s: f"{s.distance_offset:.3f}",
    "time offset, s": lambda s: f"{s.time_offset:.3f}",
    "unseen stops within prediction": lambda s: f"{coverage(s)[0]:.1%}",
    "predictions longer by, mean m": lambda s: f"{coverage(s)[1]:.3f}",
    "speeds, m/s": lambda s: f"{s.speed_range[0]:.2f} … {s.speed_range[1]:.2f}",
    "grades": _grades,
}
"""Label -> cell of a surface, as people read it."""
