"""Stopping distance along a measured, varying slope: the integral form of Braking (12).

v dv = −g (F_b/W(θ(s), v_i) + sin θ(s)) ds, so the distance from the onset to standstill is where
the work done equals v_i²/2. :mod:`slopewise.models.laws.braking` has (12) for one grade, and
:mod:`slopewise.models.stops.simulation` integrates every effect in time. This stands between them
because a calibration predicts each stop of a log, or of a fleet, on the ground that was measured
under it: independent of time steps, and without an integrator.
"""

from __future__ import annotations

import math

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.force_design import design
from slopewise.models.laws import braking
from slopewise.models.quantity import GRAVITY

_STEP = 0.01  # [m]
_FARTHEST = 500.0  # [m] a vehicle that rolls that far does not stop


def stopping_distance(
    speed: float,
    dead_time: float,
    coefficients: Floats,
    station: Floats,
    grade: Floats,
    margin: Floats | None = None,
    extra: Floats | None = None,
) -> float:
    """Distance from stop command to standstill, without offset [m]; inf if it does not stop.

    Args:
        speed: at the stop command, held during the dead time [m/s].
        dead_time: [s]. coefficients: (4,) m_m, b_m, m_b, b_b.
        station: (n,) from the stop command on, not decreasing [m]; grade: (n,) there [rad]. Beyond
            the last station its grade continues.
        extra: (n,) F_b/W at the stations that the coefficients do not have.
        margin: (4, 4) matrix S; the force is lower by √(φᵀ S φ), φ = (v θ, θ, v, 1).
    """
    held = speed * dead_time
    energy = 0.5 * speed * speed
    reach = max(float(station[-1]) * 1.5, held + 1.0)
    while True:
        s = np.linspace(held, reach, max(round((reach - held) / _STEP), 20) + 1)
        theta = np.interp(s, station, grade)
        force = braking.force_ratio(theta, speed, *coefficients)
        if extra is not None:
            force = force + np.interp(s, station, extra)
        if margin is not None:
            phi = design(np.full_like(theta, speed), theta)
            force = force - np.sqrt(np.einsum("ni,ij,nj->n", phi, margin, phi))
        pull = GRAVITY * (force + np.sin(theta))
        work = np.concatenate(([0.0], np.cumsum(0.5 * (pull[1:] + pull[:-1]) * np.diff(s))))
        done = np.flatnonzero(work >= energy)
        if len(done):
            k = int(done[0])
            if k == 0:
                return held
            share = (energy - work[k - 1]) / (work[k] - work[k - 1])
            return float(s[k - 1] + share * (s[k] - s[k - 1]))
        if reach > _FARTHEST:
            return math.inf
        reach *= 2.0


def stopping_time(speed: Elementwise, dead_time: Elementwise, distance: Elementwise) -> Elementwise:
    """Time from stop command to standstill [s] for a distance [m], at an even deceleration.

    Source: Braking (11), (12): v/a with the a that gives the distance.
    """
    return dead_time + 2.0 * np.maximum(distance - speed * dead_time, 0.0) / speed
