"""Change of terrain without knowing any class.

Each condition of driving has a running mean and covariance of what the seconds on this ground were
like. The latest seconds are compared with it as Hotelling's T² does: the median of their
differences, over what chance and their correlation in time make of it. Three to five seconds
decide; a single one, such as a stone, does not. Patches are told once: a difference like the last
change, or its way back, is nothing new for some twenty seconds.

Validity: changes that last, and conditions that were driven for some seconds before. Omits: ground
that differs in neither resistance, slip nor roughness, such as ice and asphalt driven straight.
Source: Hotelling (1931); the covariance is shrunk to a usual one, as after a normal-Wishart prior.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import quantity, validate_quantities
from slopewise.models.terrain.windows import Condition, SteadySecond, by_driving, usual_spread

_LEAST = 3  # windows that decide at least
_PATCHY = 0.1  # share of a change's square that is usual just after it


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeSettings:
    """How easily a change is believed."""

    threshold: float = quantity("1", "T² per channel that is a change.", default=5.0, above=0.0)
    seconds: float = quantity("s", "Latest driving that is compared.", default=5.0, at_least=3.0)
    memory: float = quantity("s", "Driving that a condition remembers.", default=60.0, at_least=5.0)
    before: float = quantity(
        "s", "Driving in a condition before it is compared with.", default=4.0, at_least=2.0
    )
    prior: float = quantity(
        "s", "Driving that the usual spread counts as.", default=10.0, at_least=1.0
    )
    patchy: float = quantity(
        "s",
        "Time constant with which it is forgotten that ground is patchy.",
        default=15.0,
        above=0.0,
    )
    alike: float = quantity(
        "1", "Correlation of one second with another.", default=0.3, at_least=0.0, at_most=0.99
    )
    shared: float = quantity(
        "1",
        "Usual correlation between bands and axes of shaking.",
        default=0.25,
        at_least=0.0,
        at_most=0.9,
    )

    def __post_init__(self) -> None:
        validate_quantities(self)


@dataclass(slots=True)
class _Usual:
    """What one condition was like so far."""

    count: float
    mean: Floats
    driving: Floats
    covariance: Floats


class ChangeDetector:
    """Follows one run window by window.

    Attributes:
        compared: windows of this run that were compared with earlier ones.
        not_compared: those that nothing driven alike came before.
    """

    def __init__(self, rates: int, settings: ChangeSettings | None = None) -> None:
        """Begin without knowledge.

        Args:
            rates: rates of turn that windows are made of.
            settings: of the detector.
        """
        self._settings = ChangeSettings() if settings is None else settings
        spread = usual_spread(rates)
        related = np.eye(len(spread))
        related[3:, 3:] += self._settings.shared * (1.0 - np.eye(len(spread) - 3))
        self._prior = np.outer(spread, spread) * related
        self._by_driving = by_driving(rates) ** 2
        self.begin()

    def begin(self) -> None:
        """Another run: forget what was usual."""
        self._patches = np.zeros_like(self._prior)
        self.compared = self.not_compared = 0
        self._anew()

    def restart(self) -> None:
        """The ground has changed, as something else tells."""
        self._anew()

    def _anew(self) -> None:
        """Other ground."""
        self._usual: dict[Condition, _Usual] = {}
        self._latest: deque[SteadySecond] = deque()

    def update(self, window: SteadySecond) -> float | None:
        """One more second of steady driving.

        Returns:
            The statistic, in units of its threshold, if the ground has changed within the latest
            seconds; what is usual then begins anew.
        """
        self._latest.append(window)
        self._patches *= math.exp(-1.0 / self._settings.patchy)
        statistic, off = self._statistic()
        found = statistic / self._settings.threshold
        if found > 1.0:
            latest = list(self._latest)[-_LEAST:]
            self._anew()
            self._patches = _PATCHY * np.outer(off, off)
            for late in latest:
                self._learn(late)
            return found
        while len(self._latest) > self._settings.seconds:
            self._learn(self._latest.popleft())
        return None

    def _statistic(self) -> tuple[float, Floats]:
        """Largest T² per channel over the latest three, four … windows, and its (channels,) off."""
        s = self._settings
        known = [
            (window, usual)
            for window in reversed(self._latest)
            if (usual := self._usual.get(window.condition)) and usual.count >= s.before
        ]
        off = np.zeros(len(self._prior))
        if len(known) < _LEAST:
            self.not_compared += 1
            return 0.0, off
        self.compared += 1
        differences = np.array([window.channels - usual.mean for window, usual in known])
        driving = np.array([window.driving - usual.driving for window, usual in known])
        count = np.arange(1, len(known) + 1)
        # the median of so many is 1.2 times as uncertain as their mean
        late = 1.2 * (1.0 + (count - 1.0) * s.alike) / count
        early = count / np.cumsum([usual.count for _, usual in known])
        covariance = np.cumsum([usual.covariance for _, usual in known], axis=0)
        spread = covariance * ((late + early) / count)[:, None, None] + self._patches
        excused = (np.cumsum(driving, axis=0) / count[:, None]) ** 2 @ self._by_driving.T
        np.einsum("nii->ni", spread)[...] += excused
        medians = np.array([_median(differences[:n]) for n in range(_LEAST, len(known) + 1)])
        measured = np.flatnonzero(np.isfinite(differences.sum(axis=0)))
        medians, spread = medians[:, measured], spread[_LEAST - 1 :, measured[:, None], measured]
        solved = np.linalg.solve(spread, medians[:, :, None])[..., 0]
        distance = np.einsum("ni,ni->n", medians, solved)
        best = int(np.argmax(distance))
        off[measured] = medians[best]
        return float(distance[best]) / max(len(measured), 1), off

    def _learn(self, window: SteadySecond) -> None:
        s = self._settings
        x = np.nan_to_num(window.channels)
        usual = self._usual.get(window.condition)
        if usual is None:
            self._usual[window.condition] = _Usual(
                1.0, x.copy(), window.driving.copy(), self._prior.copy()
            )
            return
        usual.count = min(usual.count + 1.0, s.memory)
        usual.driving += (window.driving - usual.driving) / usual.count
        difference = x - usual.mean
        usual.mean += difference / usual.count
        scatter = np.outer(difference, x - usual.mean)
        usual.covariance += (scatter - usual.covariance) / (s.prior + usual.count)


def _median(values: Floats) -> Floats:
    """(channels,) of few rows; NumPy's own is slow for these."""
    ordered = np.sort(values, axis=0)
    median: Floats = 0.5 * (ordered[(len(values) - 1) // 2] + ordered[len(values) // 2])
    return median
