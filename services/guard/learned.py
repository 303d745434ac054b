"""Parameters of the running service, as far as they concern a stop."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.services.guard.model_reader import SPREAD, GuardModel, rows_of
from slopewise.services.guard.stops import Tables
from slopewise.services.wire.parameter_messages import ParameterGroup

_FORCE = ("m_m", "b_m", "m_b", "b_b")
_BRAKING, _LIMITS, _EFFECTS = "braking", "limits", "effects"


@dataclass(slots=True)
class Learned:
    """The newest groups, by name.

    Without ``trusted`` what was learned can only make stops longer: both are held against every
    command, what the model file says and what was learned, and the worse counts.
    """

    model: GuardModel
    trusted: bool
    groups: dict[str, ParameterGroup] = field(default_factory=dict)

    def take(self, group: ParameterGroup) -> None:
        """A group that the service published."""
        numbers = [*group.values.values(), *group.stds.values()]
        if np.isfinite(numbers).all() and len(self.groups) < 64:
            self.groups[group.group] = group

    def tables(self) -> Tables:
        """Surfaces as rows: of the model file, and as learned."""
        own = rows_of(self.model)
        learned = own.copy()
        changed = False
        for k, name in enumerate(self.model.surfaces):
            group = self.groups.get(f"{_BRAKING}.{name}" if name else _BRAKING)
            if group is None or not all(key in group.values for key in _FORCE):
                continue
            learned[k] = self._row(own[k], group)
            changed = True
        if not changed:
            return (own,)
        learned[-1, 15] = learned[:, 15].max()
        return (learned,) if self.trusted else (own, learned)

    def _row(self, row: Floats, group: ParameterGroup) -> Floats:
        new = row.copy()
        new[:4] = [group.values[key] for key in _FORCE]
        new[3] -= SPREAD * group.stds.get("b_b", 0.0)
        # Uphill the file's own coefficients hold where they are others than downhill.
        if np.array_equal(row[4:6], row[:2]):
            new[4:6] = new[:2]
        new[15] = max(group.values.get("dead_time", row[15]), row[15])
        return new

    def limited(self) -> GuardModel:
        """The model with limits that an operator set tighter."""
        group = self.groups.get(_LIMITS)
        if group is None:
            return self.model
        speed = min(self.model.speed, group.values.get("speed", self.model.speed))
        lateral = min(self.model.lateral, group.values.get("lateral_accel", self.model.lateral))
        return self.model._replace(speed=max(speed, 0.0), lateral=max(lateral, 0.0))

    def flags(self) -> list[str]:
        """What is not as it should be."""
        group = self.groups.get(_EFFECTS)
        if group is not None and group.values:
            return ["effects that were adopted are not known to the guard: restart it with them"]
        return []
