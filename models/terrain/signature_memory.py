"""What the signatures of one run tell together, as they come.

Ground lasts: each signature changes the probabilities of the one before, with a small chance that
the ground changed in between. How strange the ground is, is a mean over the latest signatures.
Where that is beyond the model's threshold the answer is none of these, whatever the classes say.

Source: forward filter of a hidden Markov model; the test is one of distance with a stated rate.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from slopewise.models.quantity import quantity, validate_quantities
from slopewise.models.terrain.classifier import NONE, Classification
from slopewise.models.terrain.signature import Signature
from slopewise.models.terrain.signature_model import SignatureModel


@dataclass(frozen=True, slots=True, kw_only=True)
class MemorySettings:
    """How long the ground is taken to last."""

    change: float = quantity(
        "1",
        "Probability that the ground changes from one signature to the next.",
        default=0.03,
        above=0.0,
        at_most=0.5,
    )
    weight: float = quantity(
        "1",
        "Share of its evidence that a signature adds: neighbours repeat each other.",
        default=0.6,
        above=0.0,
        at_most=1.0,
    )
    latest: float = quantity(
        "1", "Signatures that strangeness is averaged over.", default=6.0, at_least=1.0
    )
    steepness: float = quantity(
        "1",
        "How fast the probability of unknown ground rises about the threshold.",
        default=2.0,
        above=0.0,
    )

    def __post_init__(self) -> None:
        validate_quantities(self)


class SignatureMemory:
    """Follows one run.

    Attributes:
        model: what it asks.
        strangeness: mean over the latest signatures, NaN before the first.
    """

    def __init__(self, model: SignatureModel, settings: MemorySettings | None = None) -> None:
        """Begin without knowledge."""
        self.model = model
        self._settings = MemorySettings() if settings is None else settings
        self.begin()

    def begin(self) -> None:
        """Another run, or other ground."""
        count = len(self.model.classes)
        self._belief = np.full(count, 1.0 / count)
        self._strange: deque[float] = deque(maxlen=int(self._settings.latest))
        self.strangeness = math.nan

    def update(self, signature: Signature) -> Classification:
        """One more signature; probabilities of all classes and of none of these."""
        log, strange = self.model.look(signature)
        changed = self._settings.change
        belief = (1.0 - changed) * self._belief + changed / len(self._belief)
        belief *= np.exp(self._settings.weight * log)
        self._belief = belief / belief.sum()
        if math.isfinite(strange):
            self._strange.append(strange)
            self.strangeness = sum(self._strange) / len(self._strange)
        unknown = self._unknown()
        found = dict(
            zip(self.model.classes, ((1.0 - unknown) * self._belief).tolist(), strict=True)
        )
        best = NONE if unknown >= 0.5 else max(found, key=lambda name: found[name])
        found[NONE] = unknown
        return Classification(best, found[best], found)

    def _unknown(self) -> float:
        """Probability of unknown ground: one half at the threshold. Nothing measured: unknown."""
        beyond = self.strangeness - self.model.threshold
        if not math.isfinite(beyond):
            return 1.0
        return 1.0 / (1.0 + math.exp(-min(max(self._settings.steepness * beyond, -50.0), 50.0)))
