"""Turns of a path against the steering, from the curvature along it alone, in separate steps.

The angle β between path and body obeys dβ/ds = κ − sin β / e; the wheels stand at
tan δ = (arm / e) tan β, and where the reference point is the steering centre, at tan δ = arm κ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Model
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.verify.track import SteeringTerms, Track

_TOLERANCE = 0.05
"""Share by which curvature and rate may be exceeded [1]: curvature at stations, linear between
them, against the turns of a polyline."""

_SUBSTEPS = 4
"""Of the integrator between two stations [1]: 0.25 m are then a tenth of e of a vehicle with a
wheelbase of 1.2 m."""


class Steered(NamedTuple):
    """How far a path is within the steering; (N,) each.

    Attributes:
        excess: curvature beyond the largest one, <= 0 within it [1/m].
        max_speed: from each station to the next, by the rate of the steering angle [m/s].
    """

    excess: Floats
    max_speed: Floats


def steering_terms(model: Model) -> SteeringTerms:
    """The steering of a vehicle."""
    geometry = model.steering_geometry
    return SteeringTerms(
        geometry.centre_offset, geometry.arm, geometry.max_curvature, geometry.max_rate
    )


@kernel
def follow_steering(track: Track, terms: SteeringTerms) -> Steered:
    """Walk a track once.

    Near its first station the heading of the body is an assumption, which decays like
    exp(−s/e): the tolerance is wider there by that.
    """
    stations = track.station.shape[0]
    steered = Steered(np.full(stations, -np.inf), np.full(stations, np.inf))
    if np.isinf(terms.max_curvature) and np.isinf(terms.max_rate):
        return steered
    rod, driven = terms.centre_offset, 0.0
    beta, before = _first_angle(track, rod), 0.0
    for k in range(stations):
        if k > 0:
            step = track.station[k] - track.station[k - 1]
            step *= np.cos(0.5 * (track.grade[k] + track.grade[k - 1]))
            driven += step
            beta = _next_angle(beta, track.curvature[k - 1], track.curvature[k], step, rod)
        curvature = track.curvature[k] if rod == 0.0 else np.sin(beta) / rod
        slack = _TOLERANCE if rod == 0.0 else _TOLERANCE + np.exp(-driven / rod)
        # κ of the steering centre is that of the path over the cosine of β.
        angle = np.arctan(terms.arm * curvature / max(np.cos(beta), 1e-6))
        if k > 0:
            steered.excess[k] = abs(curvature) - (1.0 + slack) * terms.max_curvature
            turned = abs(angle - before)
            if turned > 0.0:
                steered.max_speed[k - 1] = (1.0 + slack) * terms.max_rate * step / turned
        before = angle
    return steered


@inlined
def _first_angle(track: Track, rod: float) -> float:
    """Of a steady turn with the mean curvature of the first e of the path."""
    total, count = 0.0, 0
    for k in range(track.station.shape[0]):
        total, count = total + track.curvature[k], count + 1
        if track.station[k] - track.station[0] >= rod:
            break
    return float(np.arcsin(min(max(rod * total / count, -1.0), 1.0)))


@inlined
def _next_angle(beta: float, first: float, second: float, step: float, rod: float) -> float:
    """β a step further, by Heun's method, the curvature linear in between."""
    if rod == 0.0:
        return 0.0
    h = step / _SUBSTEPS
    for n in range(_SUBSTEPS):
        u, w = n / _SUBSTEPS, (n + 1) / _SUBSTEPS
        here = first + u * (second - first) - np.sin(beta) / rod
        there = first + w * (second - first) - np.sin(beta + h * here) / rod
        beta += 0.5 * h * (here + there)
    return float(min(max(beta, -1.5), 1.5))
