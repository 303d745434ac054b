"""Do the brakes answer to slopes uphill as they do downhill?

The braking model has one slope coefficient for both ways. Where stops show another one uphill, it
leaves the difference as scatter: then uphill gets coefficients of its own (:mod:`.uphill`).

F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b) + k max(θ, 0). Source: Braking Sec. 2, which names
coefficients of their own for uphill and downhill as an extension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.force_design import design
from slopewise.models.stop_logs import random_effects

_FEWEST = 8  # stops on each side
_STEEP = 0.035  # [rad] from which a slope has a side
_PRIOR = 1.0  # [1/rad] wide beside any asymmetry that brakes have
_SURE = 3.5  # standard deviations


@dataclass(frozen=True, slots=True)
class Asymmetry:
    """Change of the slope coefficient from downhill to uphill [1/rad], and its deviation."""

    value: float
    std: float

    @property
    def clear(self) -> bool:
        """It is no chance."""
        return abs(self.value) > _SURE * self.std

    def times(self, factor: float) -> Asymmetry:
        """That of brakes that are a factor as strong."""
        return Asymmetry(factor * self.value, factor * self.std)


def asymmetry(
    speed: Floats, grade: Floats, force_ratio: Floats, noise: Floats, prior: tuple[float, ...]
) -> Asymmetry | None:
    """Asymmetry of some stops, None where one side has too few.

    Args:
        speed: (n,) onset speeds [m/s]. grade: (n,) mean θ while braking [rad].
        force_ratio: (n,) gravity-free F_b/W. noise: (n,) its measurement noise.
        prior: standard deviations of the other four coefficients, about nothing.
    """
    if min(int((grade > _STEEP).sum()), int((grade < -_STEEP).sum())) < _FEWEST:
        return None
    x = np.column_stack((design(speed, grade), np.maximum(grade, 0.0)))
    fit = random_effects.fit(
        x, force_ratio, noise, np.zeros(5), np.diag(np.square((*prior, _PRIOR)))
    )
    return Asymmetry(float(fit.coefficients[4]), float(np.sqrt(fit.covariance[4, 4])))
