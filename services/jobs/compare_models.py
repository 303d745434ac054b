"""Compare two model files: keys with another value, and the change of stopping distances."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from slopewise.models.errors import InputError
from slopewise.models.laws import braking
from slopewise.models.laws.wheel_lockup import friction_cap
from slopewise.models.parameters import Model
from slopewise.models.stops.simulation import force_law
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.jobs.summary import Summary

_STEPS = 9  # speeds, and grades, of the trained ranges at which stops are compared [1]


class KeyChange(Summary, frozen=True):
    """Values of a key, null where it is absent."""

    before: Any
    after: Any


class StopChange(Summary, frozen=True):
    """Smallest and largest change of stopping distances on a surface [m]; below 0: shorter."""

    surface: str
    smallest: float = msgspec.field(name="least")
    largest: float = msgspec.field(name="most")


class ModelComparison(Summary, frozen=True):
    """Output of `params diff --json`."""

    files: list[str]
    keys: dict[str, KeyChange]
    stops: list[StopChange]


def compare_models(files: Sequence[Path]) -> ModelComparison:
    if len(files) != 2:
        raise InputError("params diff", "", f"expected two model files, got {len(files)}")
    first, second = (read_model(find_model(str(file))) for file in files)
    before, after = (dict(_flat(model_to_dict(model))) for model in (first, second))
    changes = {
        key: KeyChange(before.get(key), after.get(key))
        for key in sorted(before.keys() | after.keys())
        if before.get(key) != after.get(key)
    }
    return ModelComparison([str(file) for file in files], changes, list(_stops(first, second)))


def _flat(value: Any, where: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list) and value and isinstance(value[0], Mapping):
        for index, item in enumerate(value):
            yield from _flat(item, f"{where}[{index}]")
    else:
        yield where, value


def _stops(first: Model, second: Model) -> Iterator[StopChange]:
    """Changes on the base and on every surface that either file names, without effects."""
    for name in dict.fromkeys(("", *first.braking.terrain, *second.braking.terrain)):
        old = first.braking.on(name)
        speeds, grades = (np.linspace(*ends, _STEPS) for ends in (old.speed_range, old.grade_range))
        before, after = (
            np.array([[_distance(model, name, v, grade) for v in speeds] for grade in grades])
            for model in (first, second)
        )
        change = (after - before)[np.isfinite(before) & np.isfinite(after)]
        if change.size:
            yield StopChange(name or "base", float(change.min()), float(change.max()))


def _distance(model: Model, surface: str, speed: float, grade: float) -> float:
    """Stopping distance from a speed [m/s] on a grade [rad] [m]; inf where no brakes stop."""
    on = model.braking.on(surface)
    force = force_law(replace(model, effect=()), on, speed)({"grade": grade})
    if on.sliding_friction is not None:
        force = min(force, float(friction_cap(grade, 0.0, on.sliding_friction)))
    deceleration = float(braking.deceleration(force, grade))
    if deceleration <= 0.0:
        return math.inf
    return float(braking.stopping_distance(speed, deceleration, on.dead_time, on.distance_offset))
