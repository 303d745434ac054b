"""The four coefficients of the braking model by one joint, robust least squares.

F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b): linear in the coefficients, so the vectors
[v θ, θ, v, 1] of all stops make one regression of the gravity-free force.
Source: Braking (7)–(10); print regresses the deceleration with gravity in it, in two stages, and
labels the vector of (10) [m_m, m_b] where it is [m_m, b_m]. One stage is better conditioned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.force_design import design
from slopewise.models.stop_logs import random_effects
from slopewise.models.stop_logs.random_effects import Bounds, LinearFit

NAMES = ("m_m", "b_m", "m_b", "b_b")
"""Order of coefficients and covariance."""

WEAK_PRIOR = (0.2, 0.7, 0.1, 1.0)
"""Standard deviations around the coefficients known before [s/m, 1, s/m, 1]. Wide compared
with the information of a few dozen stops; without any, as on slope coefficients on level ground,
the known coefficient stays."""

_GROUPS = 4  # of speeds, in the paper's own estimator

MIRRORED_SLOPE = -1.0
"""Slope coefficient c below which grades have the wrong sign [1]: by such grades the deceleration
over g changes by -1 - c instead of 1 + c, and falls the steeper a vehicle drives uphill."""


@dataclass(frozen=True, slots=True)
class ForceFit:
    """Coefficients in the order of :data:`NAMES`.

    Attributes:
        coefficients: (4,). covariance: (4, 4).
        learned: (4,) share of each coefficient's prior variance that the stops removed, 0 … 1.
        scatter: of F_b/W from stop to stop, standard deviation.
        regression: residuals and weights, one entry a stop.
    """

    coefficients: Floats
    covariance: Floats
    learned: Floats
    scatter: float
    regression: LinearFit

    def force_ratio(self, speed: Floats | float, grade: Floats | float) -> Floats:
        """F_b/W at onset speeds [m/s] and grades [rad], (n,) or numbers, broadcast."""
        m_m, b_m, m_b, b_b = self.coefficients
        return np.asarray((m_m * speed + b_m) * grade + m_b * speed + b_b)

    def force_std(self, speed: Floats | float, grade: Floats | float) -> Floats:
        """(n,) standard deviation of F_b/W at speeds [m/s] and grades [rad], (n,) or numbers.

        From the coefficients alone.
        """
        x = design(np.atleast_1d(speed), np.atleast_1d(grade))
        return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", x, self.covariance, x)))


def fit_force(
    speed: Floats,
    grade: Floats,
    force_ratio: Floats,
    noise: Floats,
    known: Floats,
    *,
    common: tuple[Floats, float] | None = None,
    bounds: Bounds | None = None,
) -> ForceFit:
    """Joint fit of all four coefficients.

    Args:
        speed: (n,) onset speeds [m/s]. grade: (n,) mean θ while braking [rad].
        force_ratio: (n,) gravity-free F_b/W. noise: (n,) its measurement noise.
        known: (4,) coefficients known before.
        common: what errs alike in all stops: (n,) change of the force with it, and its standard
            deviation.
        bounds: lower bounds of forces; none of them counts that the fit obeys.
    """
    prior = np.diag(np.square(WEAK_PRIOR))
    regression = random_effects.fit_with_bounds(
        design(speed, grade), force_ratio, noise, known, prior, bounds
    )
    covariance = regression.covariance
    if common is not None:
        direction = regression.gain @ common[0] * common[1]
        covariance = covariance + np.outer(direction, direction)
    learned = np.clip(1.0 - np.diag(covariance) / np.diag(prior), 0.0, 1.0)
    return ForceFit(
        regression.coefficients,
        0.5 * (covariance + covariance.T),
        learned,
        regression.scatter,
        regression,
    )


def by_mount(coefficients: Floats, mount_std: float) -> Floats:
    """(4, 4) covariance that coefficients (4,) have because all their grades may be off alike.

    Grades that are e too low make F_b/W come out (1 + m) e too high at any grade.
    ``mount_std``: of the offset of the pitch sensor [rad].
    """
    m_m, b_m = coefficients[:2]
    direction = mount_std * np.array([0.0, 0.0, m_m, 1.0 + b_m])
    return np.outer(direction, direction)


def fit_two_stages(speed: Floats, grade: Floats, force_ratio: Floats) -> Floats | None:
    """The paper's own estimator, for comparison: lines over grade in speed groups, then over speed.

    Groups hold equally many stops. Source: Braking (9), (10), with the gravity-free force and the
    labels corrected.

    Returns:
        (4,) coefficients, None where a group has no two grades or the groups no two speeds.
    """
    order = np.argsort(speed, kind="stable")
    lines, centres = [], []
    for members in np.array_split(order, _GROUPS):
        if len(members) < 3 or np.ptp(grade[members]) < 1e-6:
            return None
        lines.append(np.polyfit(grade[members], force_ratio[members], 1))
        centres.append(float(np.mean(speed[members])))
    if np.ptp(centres) < 1e-6:
        return None
    m_m, b_m = np.polyfit(centres, [line[0] for line in lines], 1)
    m_b, b_b = np.polyfit(centres, [line[1] for line in lines], 1)
    return np.array([m_m, b_m, m_b, b_b])
