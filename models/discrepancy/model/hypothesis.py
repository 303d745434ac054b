"""A hypothesis: a base model with shifted coefficients, a dead time and further effects.

A hypothesis is a vector of free numbers: shifts of m_m, b_m, m_b, b_b, the dead time, then the free
parameters of each effect. Parameters that no derivative reaches (a run's number, a place) stay
unchanged in a fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Effect, Model

MAX_STEPS = 25  # of an iteration: each ends before, where nothing is gained
BASE = len(NAMES) + 1
"""Numbers before those of the effects: four shifts and the dead time."""


def is_placed(name: str) -> bool:
    """Whether an effect acts in one place, which is found by trying."""
    how = LAWS[name].search
    return how is not None and how.placed


def free_parameters(effect: Effect) -> tuple[str, ...]:
    """Names that a fit may move continuously."""
    known = LAWS[effect.name].parameters
    return tuple(name for name in effect.parameters if known[name].fitted)


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One candidate for the truth.

    Attributes:
        model: as configured, with the effects that it has already.
        shift: (4,) added to m_m, b_m, m_b, b_b on every surface. dead_time: [s].
        added: effects beyond those of the model. A lasting change holds from its run on.
    """

    model: Model
    shift: Floats
    dead_time: float
    added: tuple[Effect, ...] = ()

    @classmethod
    def configured(cls, model: Model) -> Hypothesis:
        """The model as configured."""
        return cls(model, np.zeros(4), model.braking.dead_time)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects added."""
        return tuple(effect.name for effect in self.added)

    @property
    def free(self) -> Floats:
        """(P,) the free numbers."""
        parameters = [e.parameters[n] for e in self.added for n in free_parameters(e)]
        return np.array([*self.shift, self.dead_time, *parameters])

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """(P,), (P,) lowest and highest of each free number, physical signs and sizes."""
        low, high = [-np.inf] * 4 + [0.0], [np.inf] * 4 + [10.0]
        for effect in self.added:
            for name in free_parameters(effect):
                lowest, highest = LAWS[effect.name].parameters[name].fit_bounds
                low.append(lowest)
                high.append(highest)
        return np.array(low), np.array(high)

    @property
    def scales(self) -> Floats:
        """(P,) of each free number, for steps and damping."""
        parameters = [
            LAWS[e.name].parameters[n].step_at(e.parameters[n])
            for e in self.added
            for n in free_parameters(e)
        ]
        return np.array([0.01, 0.05, 0.01, 0.01, 0.01, *parameters])

    def moved(self, free: Floats) -> Hypothesis:
        """The same with other numbers (P,), in the order of :attr:`free`."""
        rest = list(free[BASE:])
        added = []
        for effect in self.added:
            values = dict(effect.parameters)
            for name in free_parameters(effect):
                values[name] = float(rest.pop(0))
            added.append(replace(effect, parameters=values, covariance=None))
        return replace(self, shift=np.array(free[:4]), dead_time=float(free[4]), added=tuple(added))
