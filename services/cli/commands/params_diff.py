"""`slopewise params diff A B`: what differs between two model files, and what it does to stops."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from slopewise.models.errors import InputError
from slopewise.models.laws import braking
from slopewise.models.parameters import Braking, Model
from slopewise.services.io.model_file import find_model, model_to_dict, read_model

_STEPS = 9


@dataclass(frozen=True, slots=True)
class SurfaceShift:
    """By how much stops on a surface change, least and most [m]; below 0 they become shorter."""

    surface: str
    least: float
    most: float


@dataclass(frozen=True, slots=True)
class ModelDifference:
    """Keys with another value, before and after, None where there is none; and stops."""

    names: tuple[str, str]
    keys: dict[str, tuple[Any, Any]]
    stops: tuple[SurfaceShift, ...]


def run(files: list[Path]) -> ModelDifference:
    """Compare two model files.

    Raises:
        InputError: there are not two of them, or one is no model file.
    """
    if len(files) != 2:
        raise InputError("params diff", "", f"expected two model files, got {len(files)}")
    first, second = (read_model(find_model(str(file))) for file in files)
    before, after = (dict(_flat(model_to_dict(model))) for model in (first, second))
    keys = {
        key: (before.get(key), after.get(key))
        for key in sorted(before.keys() | after.keys())
        if before.get(key) != after.get(key)
    }
    return ModelDifference((str(files[0]), str(files[1])), keys, tuple(_stops(first, second)))


def _flat(value: Any, where: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list) and value and isinstance(value[0], Mapping):
        for index, item in enumerate(value):
            yield from _flat(item, f"{where}[{index}]")
    else:
        yield where, value


def _stops(first: Model, second: Model) -> Iterator[SurfaceShift]:
    """Shifts of the base and of every surface that either file names, effects left out."""
    for name in dict.fromkeys(("", *first.braking.terrain, *second.braking.terrain)):
        old, new = first.braking.on(name), second.braking.on(name)
        speed, grade = np.meshgrid(
            np.linspace(*old.speed_range, _STEPS), np.linspace(*old.grade_range, _STEPS)
        )
        shift = _distances(new, speed, grade) - _distances(old, speed, grade)
        told = shift[np.isfinite(shift)]
        if told.size:
            yield SurfaceShift(name or "base", float(told.min()), float(told.max()))


def _distances(known: Braking, speed: np.ndarray, grade: np.ndarray) -> np.ndarray:
    """Stopping distances [m]; infinite where the brakes do not hold the vehicle."""
    force = (known.m_m * speed + known.b_m) * grade + known.m_b * speed + known.b_b
    slowing = np.asarray(braking.deceleration(force, grade))
    holds = slowing > 0.0
    distance = braking.stopping_distance(
        speed, np.where(holds, slowing, 1.0), known.dead_time, known.distance_offset
    )
    return np.where(holds, distance, math.inf)


def as_json(result: ModelDifference) -> dict[str, Any]:
    """Everything for machines."""
    return {
        "files": list(result.names),
        "keys": {key: {"before": old, "after": new} for key, (old, new) in result.keys.items()},
        "stops": [{"surface": s.surface, "least": s.least, "most": s.most} for s in result.stops],
    }


def show(result: ModelDifference, console: Console) -> None:
    """A line a key, then what it does to stops."""
    for key, (old, new) in result.keys.items():
        console.print(f"{key}: {_said(old)} → {_said(new)}", markup=False, highlight=False)
    if not result.keys:
        console.print("no difference")
    for shift in result.stops:
        if shift.least or shift.most:
            words = f"stops on {shift.surface}: {shift.least:+.2f} … {shift.most:+.2f} m"
            shorter = shift.least < -1e-9
            note = ", shorter somewhere: plans get faster" if shorter else ""
            console.print(words + note, style="yellow" if shorter else "", highlight=False)


def _said(value: Any) -> str:
    return "none" if value is None else str(value)
