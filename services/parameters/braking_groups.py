"""Parameters of braking as groups: the base, and each surface that stops were learned on."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import math
import re
import time
from collections.abc import Callable, Collection, Mapping

import msgspec

from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.learned_force import LearnedForce
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.parameters.braking_forces import DEAD_TIME_COUNT, BrakingForces
from slopewise.services.parameters.parameter_group import GroupDescription, ParameterGroups, State
from slopewise.services.parameters.stop_checks import MAX_DEAD_TIME
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire.parameter_messages import FORCE_STD, STOP_FACTOR, STOP_FACTOR_QUANTILE

BASE = "braking"
_DEAD_TIME = "dead_time"
_UNITS = ("s/m", "1", "s/m", "1", "s")
_SURFACE = re.compile(r"[A-Za-z0-9_-]{1,40}")
_MAX_COEFFICIENT = 100.0
"""Beyond the coefficients of all vehicles [s/m, 1, s/m, 1]."""


class BrakingGroups(ParameterGroups):
    """Braking on top of a model; ``forces`` holds what was learned."""

    def __init__(
        self, prior: Model, settings: Learning, map_surfaces: Callable[[], Collection[str]] = tuple
    ) -> None:
        """Begin with the model's coefficients; ``map_surfaces``: surfaces that the map names."""
        self.forces = BrakingForces(prior.braking, settings, map_surfaces)
        self._digest = hashlib.sha256(repr(prior.braking).encode()).hexdigest()[:16]

    def copy(self) -> BrakingGroups:
        """A second one that learns separately from the same model."""
        clone = copy.copy(self)
        clone.forces = self.forces.copy()
        return clone

    def restrict_to_file(self) -> set[str]:
        return set(map(group_of, self.forces.restrict_to_prior()))

    def assume_untrained(self) -> set[str]:
        """Assume brakes that may be worn where nothing was learned; the groups that changed."""
        return set(map(group_of, self.forces.assume_untrained()))

    def common_age(self, ages: Mapping[str, float]) -> float:
        """Age that all groups have at least [s]; 0 while one is as in the model file."""
        return min(ages.values()) if len(ages) == len(self.names()) else 0.0

    def apply(self, model: Model) -> Model:
        ages = self.forces.ages(time.monotonic())
        common = self.common_age(ages)
        beyond = {name: age - common for name, age in ages.items()}
        return dataclasses.replace(model, braking=self.forces.planning_braking(beyond))

    def names(self) -> list[str]:
        surfaces = dict.fromkeys((*self.forces.prior.terrain, *self.forces.learned()))
        return [BASE, *(group_of(name) for name in surfaces if name)]

    def owns(self, group: str) -> bool:
        surface = group.removeprefix(f"{BASE}.")
        if group == BASE or surface in self.forces.prior.terrain:
            return True
        return surface != group and _SURFACE.fullmatch(surface) is not None

    def describe(self, group: str) -> GroupDescription:
        surface = surface_of(group)
        force = self.forces.learned().get(surface)
        used = self.forces.planning_braking({}).on(surface)
        matrix, stds = used.covariance, dict[str, float]()
        if matrix is not None:
            stds = {name: math.sqrt(max(matrix[i][i], 0.0)) for i, name in enumerate(NAMES)}
        notes: dict[str, str | float] = {}
        if force is not None:
            # Keys of the message.
            notes = {"stops believed": force.accepted}  # words: ok
            notes |= {"stops not believed": force.gated}  # words: ok
            notes |= {f"estimate {n}": v for n, v in zip(NAMES, force.estimate, strict=True)}
        values = {name: getattr(used, name) for name in (*NAMES, _DEAD_TIME)}
        unit = dict(zip((*NAMES, _DEAD_TIME), _UNITS, strict=True))
        if used.distance is not None:
            values[STOP_FACTOR] = used.distance.worst(STOP_FACTOR_QUANTILE)
            values[FORCE_STD] = used.force_std
            unit |= {STOP_FACTOR: "1", FORCE_STD: "1"}
        return GroupDescription(
            values=values,
            stds=stds,
            covariance=None if matrix is None else [list(row) for row in matrix],
            unit=unit,
            valid=force is not None and force.valid,
            age=self.forces.ages(time.monotonic()).get(surface, 0.0),
            notes=notes,
        )

    def state(self, group: str) -> State | None:
        surface = surface_of(group)
        force = self.forces.learned().get(surface)
        dead_times = [] if surface else [*self.forces.dead_times]
        if force is None and not dead_times:
            return None
        learned = None if force is None else msgspec.to_builtins(force)
        return {"learned": learned, "prior": self._digest, "dead_times": dead_times}

    def restore(self, group: str, state: State | None, age: float) -> None:
        """Restore a surface, and with the base the dead times."""
        surface = surface_of(group)
        learned = None if state is None else state["learned"]
        dead_times = [] if state is None else msgspec.convert(state["dead_times"], list[float])
        if not all(0.0 <= t <= MAX_DEAD_TIME for t in dead_times):
            raise ParameterError(_DEAD_TIME, f"0 … {MAX_DEAD_TIME:g} s")
        force = None if learned is None else msgspec.convert(learned, LearnedForce)
        same_prior = state is None or state["prior"] == self._digest
        if force is not None and not same_prior:
            force = dataclasses.replace(force, session=(), distance=None)
        self.forces.put(surface, force, age, confident=same_prior)
        if not surface:
            self.forces.use_dead_times(dead_times)

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """Apply an operator's coefficients; above the model file's, stops have to confirm them."""
        surface = surface_of(group)
        known = self.describe(group).values
        self._check_values(surface, values, known)
        if set(values) & set(NAMES):
            coefficients = tuple({**known, **values}[name] for name in NAMES)
            matrix = self.forces.covariance_of(surface)
            known_force = self.forces.learned().get(surface)
            promise = None if known_force is None else known_force.distance
            force = LearnedForce(coefficients, matrix, coefficients, False, 0, 0, distance=promise)
            self.forces.put(surface, force, 0.0, confident=True)
            self.forces.new_session(surface)
        if _DEAD_TIME in values:
            self.forces.use_dead_times([values[_DEAD_TIME]] * DEAD_TIME_COUNT)

    def _check_values(
        self, surface: str, values: Mapping[str, float], known: Mapping[str, float]
    ) -> None:
        for name, value in values.items():
            is_common = not surface and name == _DEAD_TIME
            if name not in known or not (name in NAMES or is_common):
                raise ParameterError(name, f"one of {', '.join(NAMES)}")
            if name != _DEAD_TIME and not abs(value) <= _MAX_COEFFICIENT:
                limit = f"{_MAX_COEFFICIENT:g} {_UNITS[NAMES.index(name)]}"
                raise ParameterError(name, f"a number of -{limit} … {limit}, got {value:g}")
        dead_time, at_least = values.get(_DEAD_TIME), self.forces.prior.dead_time
        if dead_time is not None and not at_least <= dead_time <= MAX_DEAD_TIME:
            expected = f"{at_least:g} s of the model file … {MAX_DEAD_TIME:g}, got {dead_time:g}"
            raise ParameterError(_DEAD_TIME, expected)


def group_of(surface: str) -> str:
    """Group of a surface; "" is the base."""
    return f"{BASE}.{surface}" if surface else BASE


def surface_of(group: str) -> str:
    """Surface of a group of braking; "" is the base."""
    return group[len(BASE) + 1 :]
