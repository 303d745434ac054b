"""Planning force from an online estimate: lowered immediately, raised slowly.

The force is bilinear in speed and grade, so its four values at the corners of the trained rectangle
are the model. Bounds and rates act on these four: a corner takes a lower estimate immediately,
rises to a higher one by a limited step per stop, and stays within its bounds. Between the corners
the same holds, since the model is linear in each variable.

Weak stops that alternate with others are never two in a row, as after a change, and each alone may
be an error: an estimate of the mean follows the others. Of the last stops all but one may therefore
be no weaker than what is planned with, beyond their scatter; else that falls to the second weakest
immediately. Source: none; an order statistic of a moving window.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.force_design import corner_design

WINDOW = 24
"""Length of the window of last stops [1]: weak stops count until they leave it."""

_GATE = 4.0  # standard deviations below which a stop is weak
_MIN_FORCE = 0.02  # [1] of a force


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishSettings:
    """Bounds and rates of F_b/W.

    Attributes:
        min_force, max_force: bounds of F_b/W anywhere in the trained rectangle [1].
        rise: highest rise of F_b/W with one stop [1].
        max_share: highest planning force over the initial one [1].
        valid_std, invalid_std: share of F_b/W that its standard deviation has to fall below to be
            valid, and to exceed to be so no longer.
        min_stops: minimum number of accepted stops to be valid [1].
        only_valid: no rise above the default before the estimate is valid; an invalid estimate
            falls back to the default, so that no rise is released in one step.
        window: last stops of which at most half may have been rejected [1].
    """

    min_force: float = 0.02
    max_force: float = 1.2
    rise: float = 0.01
    max_share: float = 1.5
    valid_std: float = 0.05
    invalid_std: float = 0.10
    min_stops: int = 8
    window: int = 6
    only_valid: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.min_force < self.max_force:
            raise ParameterError(
                "min_force",
                f"0 < min_force < max_force, got {self.min_force:g}, {self.max_force:g}",
            )
        if not self.max_share >= 1.0:
            raise ParameterError("max_share", f"a share >= 1, got {self.max_share:g}")
        if not 0.0 < self.valid_std < self.invalid_std:
            raise ParameterError("valid_std", "0 < valid_std < invalid_std")


class PublishedForce:
    """Coefficients for planning that follow an estimate.

    Args:
        coefficients: initial values, (4,); also the default that ageing returns to.
        speed_range, grade_range: the trained rectangle [m/s], [rad].
        settings: bounds and rates.
    """

    def __init__(
        self,
        coefficients: Floats,
        speed_range: tuple[float, float],
        grade_range: tuple[float, float],
        settings: PublishSettings | None = None,
    ) -> None:
        self.settings = settings or PublishSettings()
        down, up = grade_range
        # By how much the other end of the grades falls for each end raised: level ground stays.
        level = down < 0.0 < up
        self._other_end = np.array([[-up / down], [-down / up]]) if level else np.zeros((2, 1))
        self._corners = corner_design(speed_range, grade_range)
        self._back = np.linalg.inv(self._corners)
        self._default = self._bounded(self._corners @ coefficients)
        self._force = self._default.copy()
        self._estimate = self._default.copy()
        self.valid = False

    @property
    def coefficients(self) -> Floats:
        """(4,) m_m, b_m, m_b, b_b that may be planned with."""
        return self._back @ self._force

    @property
    def corner_forces(self) -> Floats:
        """(4,) F_b/W at the corners of the trained rectangle."""
        return self._force.copy()

    def follow(self, coefficients: Floats) -> None:
        """Follow an estimate (4,): immediately where it is lower, by a step where it is higher."""
        target = self._estimate = self._bounded(self._corners @ coefficients)
        risen = np.minimum(
            self._force + self.settings.rise,
            np.maximum(self._force, self.settings.max_share * self._default),
        )
        if self.settings.only_valid and not self.valid:
            risen = np.minimum(risen, np.maximum(self._force, self._default))
        self._force = np.minimum(target, risen)

    def fall_back(self, below: Floats | None = None) -> None:
        """Be nowhere above the default, or above other coefficients (4,), and valid no longer."""
        limit = self._default if below is None else self._bounded(self._corners @ below)
        self._force = np.minimum(self._force, limit)
        self.valid = False

    def restore(self, coefficients: Floats, estimate: Floats, *, valid: bool) -> None:
        """Restore published coefficients (4,) and the estimate (4,) they follow."""
        self._estimate = self._bounded(self._corners @ estimate)
        self._force = self._bounded(self._corners @ coefficients)
        self.valid = valid

    def update_validity(self, covariance: Floats, accepted: int, gated_share: float) -> bool:
        """Set the valid flag, with hysteresis; returns it.

        Args:
            covariance: (4, 4) of the estimate. accepted: number of accepted stops.
            gated_share: share of rejected stops in the window [1].
        """
        s = self.settings
        variance = np.einsum("ki,ij,kj->k", self._corners, covariance, self._corners)
        share = float(np.max(np.sqrt(np.maximum(variance, 0.0)) / self._estimate))
        if share > s.invalid_std or gated_share > 0.5:
            self.valid = False
            if s.only_valid:
                self.fall_back()
        elif share < s.valid_std and accepted >= s.min_stops:
            self.valid = True
        return self.valid

    def age(self, seconds: float, time_constant: float) -> None:
        """Go back towards the default where that is weaker; never rise by ageing."""
        share = -math.expm1(-max(seconds, 0.0) / time_constant)
        lower = np.minimum(self._default, self._force)
        self._force = self._force + share * (lower - self._force)

    def _bounded(self, forces: Floats) -> Floats:
        """Within bounds; a corner that is raised to the least takes none on level ground along.

        The deficit of a steep corner comes from coefficients that level stops do not determine;
        spread over the rectangle, it would be force that no stop has shown.
        """
        lowest, highest = self.settings.min_force, self.settings.max_force
        raised = np.maximum(lowest - forces, 0.0).reshape(2, 2)
        lowered = (raised * self._other_end)[::-1].ravel()
        return np.asarray(np.clip(forces - lowered, lowest, highest))


class LowStops:
    """The last stops of one surface."""

    def __init__(self) -> None:
        self._last: deque[tuple[Floats, float, float]] = deque(maxlen=WINDOW)

    def take(self, speed: float, grade: float, force_ratio: float, std: float) -> None:
        """One more stop: v_i [m/s], mean θ [rad], F_b/W and its measurement noise."""
        self._last.append((np.array([speed * grade, grade, speed, 1.0]), force_ratio, std))

    def share(self, coefficients: Floats, scatter: float) -> float:
        """Share of the force by these coefficients (4,) that all but one of the last stops had.

        1 where none is weaker than scatter makes it.
        """
        shares = []
        for x, force, std in self._last:
            expected = max(float(x @ coefficients), _MIN_FORCE)
            if force < expected - _GATE * float(np.hypot(std, scatter)):
                shares.append(max(force, _MIN_FORCE) / expected)
        return 1.0 if len(shares) < 2 else sorted(shares)[1]
