"""Errors of the pose and of the time at which a plan is used: lateral band and latency.

Errors of heights are the map's (``height_std``, ``correlation_length`` of
:class:`slopewise.models.elevation_map.ElevationMap`). Definitions: docs/vehicle_motion.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import NamedTuple

from slopewise.models.arrays import Elementwise
from slopewise.models.quantity import Quantities, non_negative, positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracking(Quantities):
    """How exactly and how late the vehicle follows a plan; no table: exactly, without delay."""

    cross_track_std: float = non_negative(
        "m",
        "Standard deviation of the distance from the planned line, on straights.",
        (0.0, 2.0),
        default=0.0,
    )
    cross_track_per_curvature: float = non_negative(
        "m²", "What each 1/m of curvature adds to it.", (0.0, 5.0), default=0.0
    )
    heading_std: float = non_negative(
        "rad",
        "Standard deviation of the heading of the body.",
        (0.0, 0.3),
        default=0.0,
        at_most=0.5,
    )
    along_track_std: float = non_negative(
        "m", "Standard deviation of the measured station.", (0.0, 5.0), default=0.0
    )
    latency: float = non_negative(
        "s",
        "From the measured state to its use; what dead_time of the brakes does not hold.",
        (0.0, 2.0),
        default=0.0,
    )
    latency_std: float = non_negative(
        "s", "Standard deviation of the latency.", (0.0, 1.0), default=0.0
    )
    lookahead: float | None = positive(
        "m",
        "Distance to the point of the line at which the tracker aims; it is off the line for about "
        "four of them. Two wheelbases, or the distance driven in 1 s, by default.",
        (0.3, 20.0),
        default=None,
    )


class InputErrors(NamedTuple):
    """The errors of a plan's inputs that it survives, at its quantile; none by default.

    Attributes:
        cross_track: distance of the reference point from the planned line, to either side [m].
        cross_track_per_curvature: what each 1/m of curvature adds to it [m²].
        heading: heading error, to either side [rad].
        along_track: distance by which the vehicle may be farther along than measured [m].
        latency: time from the measured state to its use [s].
    """

    cross_track: float = 0.0
    cross_track_per_curvature: float = 0.0
    heading: float = 0.0
    along_track: float = 0.0
    latency: float = 0.0

    @property
    def has_band(self) -> bool:
        """Whether any point of the body may have a lateral offset."""
        return max(self.cross_track, self.cross_track_per_curvature, self.heading) > 0.0

    def across(self, curvature: Elementwise) -> Elementwise:
        """Distance of the reference point from its line at path curvatures [1/m], in [m]."""
        return self.cross_track + self.cross_track_per_curvature * abs(curvature)


def input_errors(tracking: Tracking | None, quantile: float | None) -> InputErrors:
    """Errors at the quantile of a plan.

    A band has two sides: k = Φ⁻¹((1 + q) / 2) standard deviations of cross-track and of heading
    each. Their sum k σ_y + |x| sin(k σ_ψ) is kept by a share of at least q of independent normal
    errors: P(w₁|z₁| + w₂|z₂| > k) is greatest where one of the two weights, which add to one, is 0,
    for every k above 0.8. Position along the path and latency have one side: Φ⁻¹(q).

    Args:
        tracking: table of the model file, None where it has none.
        quantile: one-sided probability that margins cover, 0.5 … 1; None plans with the mean,
            which leaves the latency.
    """
    if tracking is None:
        return InputErrors()
    if quantile is None:
        return InputErrors(latency=tracking.latency)
    normal = NormalDist()
    two_sided, one_sided = normal.inv_cdf(0.5 + 0.5 * quantile), normal.inv_cdf(quantile)
    return InputErrors(
        two_sided * tracking.cross_track_std,
        two_sided * tracking.cross_track_per_curvature,
        min(two_sided * tracking.heading_std, 0.5 * math.pi),
        one_sided * tracking.along_track_std,
        tracking.latency + one_sided * tracking.latency_std,
    )


def lateral_band(errors: InputErrors, x_body: float, curvature: float = 0.0) -> float:
    """By how much a point of the body may be to either side of where it is planned [m].

    |e_y| + |x| sin |e_ψ|; what a heading error moves a point at y to the side is of second order.

    Args:
        errors: at the quantile of the plan.
        x_body: distance of the point ahead of the reference point [m].
        curvature: path curvature [1/m].
    """
    across: float = errors.across(curvature)
    return across + abs(x_body) * math.sin(errors.heading)


def describe_errors(errors: InputErrors, x_body: float) -> str:
    """Sentence on the space that errors take at an end of the body, x_body [m]; "" without any."""
    parts = []
    if errors.has_band:
        parts.append(f"{lateral_band(errors, x_body):.2f} m to either side of the body")
    if errors.along_track > 0.0:
        parts.append(f"{errors.along_track:.2f} m along the path")
    if errors.latency > 0.0:
        parts.append(f"{errors.latency:.2f} s of delay")
    return f"kept free for errors of tracking: {', '.join(parts)}" if parts else ""
