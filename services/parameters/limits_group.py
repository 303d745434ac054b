"""Limits of plans as an operator set them: tighter than the model file's, never wider."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import ClassVar

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Limits, Model
from slopewise.services.parameters.parameter_group import GroupDescription, State, ValueGroup
from slopewise.services.settings.learning_settings import Learning

_MIN_LIMIT = 0.01
"""Smallest value of each limit except min_load, in its unit: no vehicle drives within tighter ones,
and no solver distinguishes them from 0."""

_MAX_LOAD = 0.9  # largest min_load that a model may have [1]


class LimitsGroup(ValueGroup):
    """Limits that an operator set."""

    of_operators = True
    name = "limits"
    units: ClassVar = {field.name: field.metadata["unit"] for field in dataclasses.fields(Limits)}

    def __init__(self, prior: Model, settings: Learning) -> None:
        super().__init__()
        self._prior, self._path_deviation = prior.limits, prior.max_path_deviation

    def apply(self, model: Model) -> Model:
        return dataclasses.replace(model, limits=self._with(self._values))

    def _with(self, values: Mapping[str, float]) -> Limits:
        return dataclasses.replace(self._prior, **values)

    def describe(self, group: str) -> GroupDescription:
        values = {"max_path_deviation": self._path_deviation}
        known = dataclasses.asdict(self._with(self._values))
        values |= {name: value for name, value in known.items() if value is not None}
        return GroupDescription(values, valid=True, age=self._age(), unit=dict(self.units))

    def restore(self, group: str, state: State | None, age: float) -> None:
        """Restore values; where the model file is tighter by now, it holds."""
        values: dict[str, float] = {} if state is None else dict(state["values"])
        for name in values:
            if name not in self.units:
                raise ParameterError(name, f"one of {', '.join(self.units)}")
        self._with(values)
        for name, value in values.items():
            low, high = self._range(name)
            values[name] = min(max(value, low), high)
        self._replace(values, age)

    def _check(self, values: Mapping[str, float]) -> None:
        super()._check(values)
        self._with({**self._values, **values})  # they fit together

    def _range(self, name: str) -> tuple[float, float]:
        """Smallest and largest value that may be set: nowhere wider than the model file."""
        value = getattr(self._prior, name)
        known = float(self._path_deviation if value is None else value)
        if name == "min_load":
            return known, max(known, _MAX_LOAD)
        return min(_MIN_LIMIT, known), known

    def _expected(self, name: str, low: float, high: float) -> str:
        end = f"at least the {low:g}" if name == "min_load" else f"at most the {high:g}"
        return f"{super()._expected(name, low, high)}, {end} of the model file"
