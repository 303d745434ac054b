"""Compare two model files: keys with another value, and the change of stopping distances."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import InputError
from slopewise.models.laws import braking
from slopewise.models.parameters import Braking, Model
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
        old, new = first.braking.on(name), second.braking.on(name)
        speed, grade = np.meshgrid(
            np.linspace(*old.speed_range, _STEPS), np.linspace(*old.grade_range, _STEPS)
        )
        change = _distances(new, speed, grade) - _distances(old, speed, grade)
        change = change[np.isfinite(change)]
        if change.size:
            yield StopChange(name or "base", float(change.min()), float(change.max()))


def _distances(on: Braking, speed: Floats, grade: Floats) -> Floats:
    """Stopping distances at speeds [m/s] and grades [rad] [m]; inf where the brakes do not stop."""
    force = braking.force_ratio(grade, speed, *on.coefficients)
    deceleration = np.asarray(braking.deceleration(force, grade))
    is_held = deceleration > 0.0
    distance = braking.stopping_distance(
        speed, np.where(is_held, deceleration, 1.0), on.dead_time, on.distance_offset
    )
    return np.where(is_held, distance, math.inf)
