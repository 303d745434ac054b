"""Parameters of the running service that concern a stop."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slopewise.models.force_design import corner_design
from slopewise.services.guard.guard_model import SPREAD, BrakeTable, GuardModel
from slopewise.services.wire.parameter_messages import FORCE_STD, STOP_FACTOR, ParameterGroup

_FORCE = ("m_m", "b_m", "m_b", "b_b")
_BRAKING, _LIMITS, _EFFECTS = "braking", "limits", "effects"

_MAX_GROUPS = 64
"""Groups that are stored: one for each surface that a map can distinguish, limits and effects."""


@dataclass(slots=True)
class ServiceParameters:
    """Newest parameter groups by name."""

    model: GuardModel  # worst case by the model file
    # learned brakes replace those of the file; else each command has to pass with both
    trusted: bool
    required: bool = False  # the vehicle stands until the service has answered
    groups: dict[str, ParameterGroup] = field(default_factory=dict)  # by name
    waits: str = ""  # reason to stand, "" where parameters are as complete as they will be
    silence: str = ""  # flag of a service that does not answer

    def take(self, group: ParameterGroup) -> None:
        """Store a published group, unless a number of it is not finite."""
        numbers = [*group.values.values(), *group.stds.values()]
        has_slot = group.group in self.groups or len(self.groups) < _MAX_GROUPS
        if np.isfinite(numbers).all() and has_slot:
            self.groups[group.group] = group

    def in_use(self) -> GuardModel:
        """The model with learned brakes, and with the limits that an operator lowered."""
        model, (file,), limits = self.model, self.model.tables, self.groups.get(_LIMITS)
        learned = BrakeTable(*np.array(file))
        groups = [self.groups.get(f"{_BRAKING}.{n}" if n else _BRAKING) for n in model.surfaces]
        changed = {
            k: of
            for k, of in enumerate(groups)
            if of is not None and all(key in of.values for key in _FORCE)
        }
        for k, group in changed.items():
            _learn(learned, k, group)
        if changed:
            model = model._replace(tables=(learned,) if self.trusted else (file, learned))
        if limits is None:
            return model
        speed = min(model.speed, limits.values.get("speed", model.speed))
        lateral = min(model.lateral, limits.values.get("lateral_accel", model.lateral))
        return model._replace(speed=max(speed, 0.0), lateral=max(lateral, 0.0))

    def warnings(self) -> list[str]:
        """Parameters that the guard cannot use."""
        group, texts = self.groups.get(_EFFECTS), [self.silence] if self.silence else []
        if group is not None and group.values:
            texts.append(
                "effects that were adopted are not known to the guard: restart it with them"
            )
        return texts


def _learn(table: BrakeTable, k: int, group: ParameterGroup) -> None:
    """Write the learned brakes of a surface into its row."""
    # Uphill the coefficients of the file hold where they differ from those downhill.
    as_downhill = (table.up_m[k], table.up_b[k]) == (table.m_m[k], table.b_m[k])
    # Stops that are longer by a factor have a deceleration F + sin θ that is lower by it.
    factor = max(group.values.get(STOP_FACTOR, 1.0), 1.0)
    lower = 1.0 - 1.0 / factor
    for key in _FORCE:
        getattr(table, key)[k] = group.values[key] / factor
    steepest = max(-float(table.grade_min[k]), float(table.grade_max[k]))
    table.b_m[k] -= lower
    table.b_b[k] -= lower * steepest**3 / 6.0  # by which θ exceeds sin θ
    promised = STOP_FACTOR in group.values
    std = group.values.get(FORCE_STD, 0.0) if promised else group.stds.get("b_b", 0.0)
    table.b_b[k] -= SPREAD * std
    corners = corner_design(
        (table.slowest[k], table.fastest[k]), (table.grade_min[k], table.grade_max[k])
    )
    weaker = np.array([group.values[name] - getattr(table, name)[k] for name in _FORCE])
    table.extra[k] = 2.0 * (SPREAD * std + max(float(np.max(corners @ weaker)), 0.0))
    if as_downhill:
        table.up_m[k], table.up_b[k] = table.m_m[k], table.b_m[k]
    late = factor * group.values.get("dead_time", 0.0)
    table.dead_time[k] = max(late, table.dead_time[k])
