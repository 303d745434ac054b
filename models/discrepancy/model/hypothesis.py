"""What may be true: a base model with shifted coefficients, a dead time and further effects.

A hypothesis is a vector of free numbers: shifts of m_m, b_m, m_b, b_b, the dead time, then the free
parameters of each effect. Parameters that no derivative reaches (a run's number) stay as they are
while the others are fitted.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from models.arrays import Floats
from models.calibration.force_fit import NAMES
from models.discrepancy.model.body_oscillation import OSCILLATION
from models.effects.registry import LAWS
from models.parameters import Effect, Model

LAWFUL = len(NAMES) + 1
"""Numbers of the model's own law: four shifts and the dead time."""

BASE = LAWFUL + OSCILLATION
"""Numbers before those of the effects: the law's, then the oscillation of the body."""

USUAL = {
    ("headwind", "wind"): (0.0, 20.0),
    ("brake_fade", "tau"): (20.0, 3600.0),
    ("brake_lag", "tau"): (0.0, 1.0),
}
"""Sizes beyond which an effect is hardly what its name says: wind above a gale, brakes that are
cold again within seconds, which would be a curve over speed within each stop."""

_FIXED = {"step_change": ("run",)}
_SCALES = {
    "tau": 0.1, "wind": 1.0, "direction": 0.2, "mu": 0.05, "c": 0.01, "k": 0.01, "delta": 0.01,
    "scale": 0.02,
    "x": 0.5,
    "y": 0.5,
    "radius": 0.5,
}  # fmt: skip


def free_parameters(effect: Effect) -> tuple[str, ...]:
    """Names that a fit may move continuously."""
    fixed = _FIXED.get(effect.name, ())
    return tuple(name for name in effect.parameters if name not in fixed)


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One candidate for the truth.

    Attributes:
        model: as configured, with the effects that it has already.
        shift: (4,) added to m_m, b_m, m_b, b_b on every surface. dead_time: [s].
        added: effects beyond those of the model. A `step_change` holds from its run on.
        oscillation: (OSCILLATION,) of the body at the onset, see
            :mod:`models.discrepancy.model.body_oscillation` [m/s].
        oscillates: whether it may be anything but zero.
    """

    model: Model
    shift: Floats
    dead_time: float
    added: tuple[Effect, ...] = ()
    oscillation: Floats = field(default_factory=lambda: np.zeros(OSCILLATION))
    oscillates: bool = False

    @classmethod
    def configured(cls, model: Model) -> Hypothesis:
        """The model as it is."""
        return cls(model, np.zeros(4), model.braking.dead_time)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects added."""
        return tuple(effect.name for effect in self.added)

    def plus(self, effect: Effect) -> Hypothesis:
        """With one more effect."""
        return replace(self, added=(*self.added, effect))

    @property
    def free(self) -> Floats:
        """(P,) the free numbers."""
        own = [e.parameters[n] for e in self.added for n in free_parameters(e)]
        return np.array([*self.shift, self.dead_time, *self.oscillation, *own])

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """(P,), (P,) lowest and highest of each free number, physical signs and sizes."""
        low, high = [-np.inf] * 4 + [0.0], [np.inf] * 4 + [10.0]
        low, high = low + [-np.inf] * OSCILLATION, high + [np.inf] * OSCILLATION
        for effect in self.added:
            law = LAWS[effect.name].parameters
            for name in free_parameters(effect):
                usual = USUAL.get((effect.name, name), (-np.inf, np.inf))
                low.append(max(law[name][1], usual[0]))
                high.append(min(law[name][2], usual[1]))
        return np.array(low), np.array(high)

    @property
    def scales(self) -> Floats:
        """(P,) of each free number, for steps and damping."""
        own = [_scale(e, n) for e in self.added for n in free_parameters(e)]
        return np.array([0.01, 0.05, 0.01, 0.01, 0.01, *[0.01] * OSCILLATION, *own])

    def moved(self, free: Floats) -> Hypothesis:
        """The same with other numbers (P,), in the order of :attr:`free`."""
        rest = list(free[BASE:])
        added = []
        for effect in self.added:
            values = dict(effect.parameters)
            for name in free_parameters(effect):
                values[name] = float(rest.pop(0))
            added.append(replace(effect, parameters=values, covariance=None))
        return replace(
            self, shift=np.array(free[:4]), dead_time=float(free[4]), added=tuple(added),
            oscillation=np.array(free[LAWFUL:BASE]),
        )  # fmt: skip


def _scale(effect: Effect, name: str) -> float:
    if effect.name == "brake_fade":
        return max(abs(effect.parameters[name]) * 0.1, 1e-6)
    if effect.name == "session_drift":
        return 1e-5
    return _SCALES[name]
