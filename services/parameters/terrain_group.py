"""Terrain parameters of the ground driven now: f_r, μ_t, B_s. Source: Slip, Sec. 3.2.

Each counts with the upper end of its one-sided 95 % interval; a vehicle that rolls on with its
drive cut counts on the lowest lower end of f_r, `braking_resistance`. A slower estimate is used
immediately, a faster one by a share of the difference and never beyond the model file, so that no
estimate, word or name of the ground makes a plan faster than the file. Values of an operator that
are faster return to the file's with age.
"""

from __future__ import annotations

import dataclasses
import math
import time
from typing import ClassVar

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.terrain.surfaces import UPPER
from slopewise.services.parameters.parameter_group import (
    DriveUpdate,
    GroupDescription,
    State,
    ValueGroup,
)
from slopewise.services.settings.learning_settings import Learning

_FASTER_SHARE = 0.2
"""Part of the difference to a faster estimate that one update follows [1]: the mean of about five
estimates, as one alone may be of a patch."""

_RANGES = ((0.001, 1.5), (0.01, 3.0), (1.0, 20.0))
"""Values beyond are gross errors: [1], [1], track widths. Steel wheels on rails roll at f_r 0.001,
and wet ice is far above μ_t 0.01."""

_MIN_CHANGE = 0.01
"""Smaller changes are not stored, as a share of the value [1]: estimates scatter by more."""


class TerrainGroup(ValueGroup):
    """Terrain parameters estimated while driving; one thread."""

    name = "terrain"
    units: ClassVar = {"motion_resistance": "1", "lateral_resistance": "1", "slip_track": "m"}

    def __init__(self, prior: Model, settings: Learning) -> None:
        super().__init__()
        self._prior, self._settings = prior, settings
        self._stds: dict[str, float] = {}
        self._rolling: float | None = None  # lower end of f_r, never above the file's [1]

    def drive(self, samples: DriveUpdate) -> set[str]:
        ground = samples.ground
        changed = self.restrict_to_file() if ground.changed else set()
        if ground.features is not None and self.learn(ground.features):
            return {self.name}
        return changed

    def learn(self, features: tuple[tuple[float, float], ...]) -> bool:
        """Learn (value, standard deviation) of each parameter, NaN unknown; True if one changed."""
        changed = False
        for name, (value, std) in zip(self.units, features, strict=True):
            low, high = self._range(name)
            upper = value + UPPER * std
            if not 0.0 <= upper <= high:
                continue
            slow = max(upper, low)
            if name == "motion_resistance" and self._prior.braking.level < 1.0:
                # Part of the braking then is this resistance: more of it would count as brakes.
                continue
            if name == "motion_resistance":
                changed |= self._learn_rolling(max(value - UPPER * std, 0.0))
            old, file = self._current()[name], float(getattr(self._prior.terrain, name))
            if slow < old <= file:
                continue
            new = slow if slow >= old else max(old + _FASTER_SHARE * (slow - old), file)
            self._stds[name] = std
            if abs(new - old) > _MIN_CHANGE * max(abs(old), 1e-3):
                self._values[name], changed = new, True
        if changed:
            self._updated = time.monotonic()
        return changed

    def _learn_rolling(self, lower: float) -> bool:
        """Learn the lower end of f_r [1], which only gets lower; True if it changed."""
        file = self._prior.terrain.rolling_while_braking
        old = file if self._rolling is None else self._rolling
        if old - lower <= _MIN_CHANGE * max(old, 1e-3):
            return False
        self._rolling = lower
        return True

    def restrict_to_file(self) -> set[str]:
        """Return to the model file where it is slower, as on other terrain."""
        slower = {n: max(v, getattr(self._prior.terrain, n)) for n, v in self._values.items()}
        changed = slower != self._values
        self._values = slower
        return {self.name} if changed else set()

    def _current(self) -> dict[str, float]:
        age = time.monotonic() - self._updated
        share = -math.expm1(-age / self._settings.grows_old)
        known = {name: float(getattr(self._prior.terrain, name)) for name in self.units}
        for name, value in self._values.items():
            known[name] = value + share * max(known[name] - value, 0.0)
        known["slip_track"] = max(known["slip_track"], self._prior.vehicle.track_width)
        return known

    def apply(self, model: Model) -> Model:
        terrain = dataclasses.replace(model.terrain, **self._current())
        file = model.terrain.rolling_while_braking
        rolling = file if self._rolling is None else min(self._rolling, file)
        if rolling < terrain.rolling_while_braking:
            terrain = dataclasses.replace(terrain, braking_resistance=rolling)
        return dataclasses.replace(model, terrain=terrain)

    def describe(self, group: str) -> GroupDescription:
        return GroupDescription(
            values=self._current(),
            stds=dict(self._stds),
            valid=bool(self._values),
            age=self._age(),
            unit=dict(self.units),
        )

    def state(self, group: str) -> State | None:
        if not self._values and self._rolling is None:
            return None
        return {"values": self._values, "stds": self._stds, "rolling": self._rolling}

    def restore(self, group: str, state: State | None, age: float) -> None:
        """Restore values of ``age`` seconds ago."""
        values: dict[str, float] = {} if state is None else dict(state["values"])
        stds = {} if state is None else {n: float(s) for n, s in state["stds"].items()}
        rolling = None if state is None else state.get("rolling")
        self._check(values)
        if not (rolling is None or 0.0 <= rolling <= 1.0):
            raise ParameterError("rolling", f"a number of 0 … 1, got {rolling:g}")
        self._replace(values, age)
        self._stds, self._rolling = stds, rolling

    def _range(self, name: str) -> tuple[float, float]:
        low, high = _RANGES[list(self.units).index(name)]
        width = self._prior.vehicle.track_width if name == "slip_track" else 1.0
        return low * width, high * width

    def _expected(self, name: str, low: float, high: float) -> str:
        return f"a number of {super()._expected(name, low, high)}"
