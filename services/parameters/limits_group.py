"""Limits of plans as an operator set them: tighter than the model file's, never wider."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Limits, Model
from slopewise.services.parameters.parameter_group import GroupDescription, ParameterGroups, State
from slopewise.services.settings.learning_settings import Learning

LIMITS = "limits"
_UNITS = {
    "speed": "m/s",
    "accel": "m/s²",
    "decel": "m/s²",
    "jerk": "m/s³",
    "lateral_accel": "m/s²",
    "vertical_accel": "m/s²",
    "min_load": "1",
    "max_path_deviation": "m",
}

_MIN_LIMIT = 0.01
"""Smallest value of each limit except min_load, in its unit: no vehicle drives within tighter ones,
and no solver distinguishes them from 0."""

_MAX_LOAD = 0.9  # largest min_load that a model may have [1]


class LimitsGroup(ParameterGroups):
    """Limits that an operator set."""

    of_operators = True

    def __init__(self, prior: Model, settings: Learning) -> None:
        """Begin with the model file's limits."""
        self._prior = prior.limits
        self._path_deviation = prior.max_path_deviation
        self._values: dict[str, float] = {}
        self._set = time.monotonic()

    def apply(self, model: Model) -> Model:
        """With the limits to plan with."""
        return dataclasses.replace(model, limits=self._active())

    def _active(self) -> Limits:
        return dataclasses.replace(self._prior, **self._values)

    def names(self) -> list[str]:
        """The one group."""
        return [LIMITS]

    def describe(self, group: str) -> GroupDescription:
        """Planning values."""
        age = time.monotonic() - self._set if self._values else 0.0
        values = {"max_path_deviation": self._path_deviation}
        known = dataclasses.asdict(self._active())
        values |= {name: value for name, value in known.items() if value is not None}
        return GroupDescription(values=values, valid=True, age=age, unit=dict(_UNITS))

    def state(self, group: str) -> State | None:
        """State for a restart."""
        return {"values": self._values} if self._values else None

    def restore(self, group: str, state: State | None, age: float) -> None:
        """Restore values; where the model file is tighter by now, it holds."""
        values: dict[str, float] = {} if state is None else dict(state["values"])
        unknown = [name for name in values if name not in _UNITS]
        if unknown:
            raise ParameterError(unknown[0], f"one of {', '.join(_UNITS)}")
        dataclasses.replace(self._prior, **values)
        for name, value in values.items():
            low, high = self._range(name)
            values[name] = min(max(value, low), high)
        self._values, self._set = values, time.monotonic() - age

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """Apply an operator's values."""
        for name, value in values.items():
            if name not in _UNITS:
                raise ParameterError(name, f"one of {', '.join(_UNITS)}")
            low, high = self._range(name)
            if not low <= value <= high:
                end = f"at least the {low:g}" if name == "min_load" else f"at most the {high:g}"
                expected = f"{low:g} … {high:g} {_UNITS[name]}, {end} of the model file"
                raise ParameterError(name, f"{expected}, got {value:g}")
        changed = {**self._values, **values}
        dataclasses.replace(self._prior, **changed)
        self._values, self._set = changed, time.monotonic()

    def _range(self, name: str) -> tuple[float, float]:
        """Smallest and largest value that may be set: nowhere wider than the model file."""
        value = getattr(self._prior, name)
        known = float(self._path_deviation if value is None else value)
        if name == "min_load":
            return known, max(known, _MAX_LOAD)
        return min(_MIN_LIMIT, known), known
