"""Signatures of a run, second by second, and what a model says of them.

Five seconds make a signature, those that were driven; without a model signatures are collected all
the same, for a model to be made of them.
"""

from __future__ import annotations

import math

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.terrain.class_change import ClassChange
from slopewise.models.terrain.classifier import Classification
from slopewise.models.terrain.signature import (
    LEAST_SECONDS,
    SENSORS,
    GroundSecond,
    SecondSettings,
    Signature,
    second_of,
    signature_of,
)
from slopewise.models.terrain.signature_memory import MemorySettings, SignatureMemory
from slopewise.models.terrain.signature_model import SignatureModel
from slopewise.models.vehicle import Vehicle

_SECONDS = 5
"""Seconds in a piece of driving that is classified as one [s]: shorter pieces are noisier, longer
ones hold a change of ground."""
_RATES = 2  # roll and pitch rate
_BEFORE_RATES = 6  # columns of a window in front of them


class SignatureWatch:
    """Follows one run.

    Attributes:
        answer: the latest, None before the first and without a model.
        change: (class before, class now, strength) if the latest second told one.
        found: signatures of this run with the window, counted from its beginning, each ended in.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        driving: tuple[float, float],
        model: SignatureModel | None = None,
        memory: MemorySettings | None = None,
        keep: bool = False,
    ) -> None:
        """Begin.

        Args:
            vehicle: with motor constants.
            driving: least rim speed that drives, and difference of the sides that turns [m/s].
            model: what answers; None: nothing does.
            memory: how long the ground is taken to last.
            keep: signatures are kept, for who learns from a run; a monitor that runs for days does
                without.
        """
        self._keep = keep
        self._settings = SecondSettings.of(vehicle, *driving)
        self._memory = None if model is None else SignatureMemory(model, memory)
        self._change = None if model is None else ClassChange(model)
        self.begin_run()

    def begin_run(self) -> None:
        """Another run."""
        self.found: list[tuple[int, Signature]] = []
        self._windows = 0
        if self._change is not None:
            self._change.begin()
        self.begin()

    def begin(self) -> None:
        """Other ground: what was told so far no longer holds."""
        self.answer: Classification | None = None
        self.change: tuple[str, str, float] | None = None
        self._seconds: list[GroundSecond] = []
        self._count = 0
        if self._memory is not None:
            self._memory.begin()

    def second(self, samples: Floats | None, rates: int) -> Classification | None:
        """One more second; an answer if it completes a signature and there is a model.

        Args:
            samples: (n, 6 + rates + accelerations) as the monitor keeps them; None if something is
                missing in the second.
            rates: rates of turn beside the yaw rate; two are roll and pitch rate.
        """
        if self._memory is None and not self._keep:
            return None
        self._windows += 1
        self._count += 1
        found = None
        if samples is not None and len(samples):
            found = second_of(_eleven(samples, rates), self._settings)
        self.change = None if self._change is None else self._change.update(found)
        if self.change is not None and self._memory is not None:  # other ground since
            self._memory.begin()
            self._seconds = self._seconds[-LEAST_SECONDS:]
        if found is not None:
            self._seconds.append(found)
        return self.close() if self._count >= _SECONDS else None

    def close(self) -> Classification | None:
        """End the signature that is open, if it has enough seconds."""
        seconds, self._seconds, self._count = self._seconds, [], 0
        signature = signature_of(seconds)
        if signature is None:
            return None
        if self._keep:
            self.found.append((self._windows, signature))
        if self._memory is not None:
            self.answer = self._memory.update(signature)
        return self.answer


def _eleven(samples: Floats, rates: int) -> Floats:
    """Columns of :func:`second_of`; NaN where a sensor is not there."""
    width = samples.shape[1] - _BEFORE_RATES
    if rates == _RATES and width == len(SENSORS) - 1:
        return samples
    full = np.full((len(samples), _BEFORE_RATES + len(SENSORS) - 1), math.nan)
    full[:, :_BEFORE_RATES] = samples[:, :_BEFORE_RATES]
    if rates == _RATES:
        full[:, _BEFORE_RATES : _BEFORE_RATES + _RATES] = samples[:, _BEFORE_RATES:][:, :_RATES]
    if width - rates == len(SENSORS) - 1 - _RATES:
        full[:, _BEFORE_RATES + _RATES :] = samples[:, _BEFORE_RATES + rates :]
    return full
