"""Change of ground told second by second from signatures, sooner than a whole signature tells it.

Each second the latest three driven seconds are asked for their class. Evidence for another class
than the one believed in adds up, less a drift, as in Page's cumulative sum; beyond a threshold the
ground has changed. It compares across ways of driving, which the statistic of the body's shaking
does not; it knows only the classes of its model. Source: Page (1954); a sequential test of one
class against each of the others. Omits: a change from one kind of unknown ground to another.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from slopewise.models.quantity import quantity, validate_quantities
from slopewise.models.terrain.signature import LEAST_SECONDS, GroundSecond, signature_of
from slopewise.models.terrain.signature_model import SignatureModel


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassChangeSettings:
    """How easily a change from class to class is believed."""

    threshold: float = quantity(
        "1", "Cumulated log likelihood ratio that is a change.", default=0.7, above=0.0
    )
    drift: float = quantity(
        "1", "Log likelihood ratio that each second takes off.", default=0.7, at_least=0.0
    )
    most: float = quantity(
        "1", "Log probability below which no class falls in one second.", default=6.0, above=0.0
    )
    sure: float = quantity(
        "1",
        "Probability of the class believed in, for others to be held against it.",
        default=0.8,
        above=0.5,
        at_most=1.0,
    )
    change: float = quantity(
        "1",
        "Probability that the ground changes from one second to the next.",
        default=0.006,
        above=0.0,
        at_most=0.5,
    )

    def __post_init__(self) -> None:
        validate_quantities(self)


class ClassChange:
    """Follows one run."""

    def __init__(self, model: SignatureModel, settings: ClassChangeSettings | None = None) -> None:
        """Begin without knowledge."""
        self._model = model
        self._settings = ClassChangeSettings() if settings is None else settings
        self.begin()

    def begin(self) -> None:
        """Another run."""
        count = len(self._model.classes)
        self._belief = np.full(count, 1.0 / count)
        self._sums = np.zeros(count)
        self._latest: deque[GroundSecond | None] = deque(maxlen=LEAST_SECONDS)

    def update(self, second: GroundSecond | None) -> tuple[str, str, float] | None:
        """One more second, None where it tells nothing.

        Returns:
            (class before, class now, cumulated ratio over the threshold) if the ground has changed.
        """
        self._latest.append(second)
        seconds = [one for one in self._latest if one is not None]
        signature = signature_of(seconds)
        if signature is None:
            return None
        s = self._settings
        log = np.fmax(self._model.probable(signature), -s.most)
        log = log / LEAST_SECONDS  # the seconds overlap so many times
        here = int(self._belief.argmax())
        if self._belief[here] > s.sure:
            self._sums = np.fmax(self._sums + log - log[here] - s.drift, 0.0)
            now = int(self._sums.argmax())
            if (found := float(self._sums[now]) / s.threshold) > 1.0:
                self._believe(now)
                return self._model.classes[here], self._model.classes[now], found
        self._belief = self._belief * np.exp(log)
        self._belief = self._belief / self._belief.sum()
        self._belief = (1.0 - s.change) * self._belief + s.change / len(self._belief)
        return None

    def _believe(self, now: int) -> None:
        """In one class, and in no change from it yet."""
        count = len(self._belief)
        self._belief = np.full(count, 0.1 / max(count - 1, 1))
        self._belief[now] = 0.9
        self._sums = np.zeros(count)
