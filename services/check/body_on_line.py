"""Pose of the body along a line, as its steering places it, and the band around it.

The steering centre of the body moves straight ahead, a distance e behind the reference point, which
stands on the line: with the heading ψ_p of the line, that of the body obeys dψ/ds = sin(ψ_p − ψ)/e.
Source: docs/vehicle_motion.md.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.input_errors import InputErrors
from slopewise.models.steering import SteeringGeometry

_SUBSTEP = 0.5  # of e: so short a step of the integrator is exact to 0.1 %
ON_LINE = 0.01  # [m] from a line, within which a vehicle is on it: maps are not more exact


class Body(NamedTuple):
    """Pose of the body at M samples of a line; arrays are (M,)."""

    x: Floats  # middle of the wheelbase [m]
    y: Floats
    heading: Floats  # [rad]
    across: Floats  # lateral error of the reference point, to either side [m]
    start_error: Floats  # remaining share of an error of the first heading, exp(−s/e) [1]
    turned: float = 0.0  # sine of the heading error
    ahead: float = 0.0  # from the reference point to the middle of the wheelbase [m]

    def band(self, ahead: float | Floats) -> Floats:
        """Lateral error, to either side, of points ahead of the middle of the wheelbase [m]."""
        band: Floats = self.across + np.abs(ahead + self.ahead) * self.turned
        return band

    def only(self, samples: Ints) -> Body:
        """Some of them."""
        x, y, heading, across, start_error = (values[samples] for values in self[:5])
        return Body(x, y, heading, across, start_error, self.turned, self.ahead)

    def at_side(self, side: float) -> Body:
        """The same at an end of the band: its left (1) or right (−1)."""
        left = side * self.across
        x, y = self.x - left * np.sin(self.heading), self.y + left * np.cos(self.heading)
        return self._replace(x=x, y=y, across=np.zeros_like(left), turned=0.0)

    def following(self, deviation: Floats, flat: Floats, wheelbase: float) -> Body:
        """The same where the vehicle follows a path within distances (M,) of the line [m].

        Its axles are on that path: the largest distance within half a wheelbase counts.
        """
        first = np.searchsorted(flat, flat - 0.5 * wheelbase)
        end = np.searchsorted(flat, flat + 0.5 * wheelbase, "right")
        largest = np.array([deviation[i:k].max() for i, k in zip(first, end, strict=True)])
        return self._replace(across=self.across + np.where(largest > ON_LINE, largest, 0.0))

    @property
    def pose(self) -> tuple[Floats, Floats, Floats, Floats]:
        """x, y [m], cos and sin of the heading, (M,) each."""
        return self.x, self.y, np.cos(self.heading), np.sin(self.heading)

    @property
    def has_band(self) -> bool:
        """Whether any point has a lateral error."""
        return self.turned > 0.0 or bool(self.across.any())


def body_along(
    place: tuple[Floats, Floats, Floats],
    flat: Floats,
    curvature: Floats,
    geometry: SteeringGeometry,
    errors: InputErrors,
) -> Body:
    """The body on M samples of a line.

    Args:
        place: x, y [m] and heading [rad] of the line. flat: metres along it, in the plan view.
        curvature: plan-view curvature of the line [1/m]. errors: tracking errors, at a quantile.
    """
    x, y, heading = place
    ahead, rod = geometry.body_offset, geometry.centre_offset
    across = errors.cross_track + errors.cross_track_per_curvature * np.abs(curvature)
    pose = x + ahead * np.cos(heading), y + ahead * np.sin(heading)
    body, start_error = heading, np.zeros_like(flat)
    if rod > 0.0:
        body, start_error = _trailing(heading, flat, rod), np.exp((flat[0] - flat) / rod)
    return Body(*pose, body, across, start_error, math.sin(errors.heading), ahead)


def _trailing(heading: Floats, flat: Floats, rod: float) -> Floats:
    """Heading of a rod that is drawn along, by the classical Runge–Kutta scheme [rad].

    It begins in a steady turn with the mean curvature of the first e of the line.
    """
    turn = float(np.interp(flat[0] + rod, flat, heading)) - heading[0]
    angle = heading[0] - math.asin(min(max(turn, -1.0), 1.0))
    body = [angle]
    for step, first, last in zip(np.diff(flat), heading[:-1], heading[1:], strict=True):
        parts = max(math.ceil(step / (_SUBSTEP * rod)), 1)
        h = step / parts / rod
        for n in range(parts):
            here = first + (last - first) * n / parts
            then = first + (last - first) * (n + 1) / parts
            middle = 0.5 * (here + then)
            k1 = h * math.sin(here - angle)
            k2 = h * math.sin(middle - angle - 0.5 * k1)
            k3 = h * math.sin(middle - angle - 0.5 * k2)
            k4 = h * math.sin(then - angle - k3)
            angle += (k1 + 2.0 * (k2 + k3) + k4) / 6.0
        body.append(angle)
    return np.array(body)
