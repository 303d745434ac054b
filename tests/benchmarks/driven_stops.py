"""Stops for the plants of missing effects, and their decelerations."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.discrepancy import plant_world, sensing
from benchmarks.discrepancy.effect_plant import DrivenStops, drive
from benchmarks.discrepancy.plant_physics import Floats, Physics, Stops

G = 9.80665


def stops(count: int = 1, **changed: float | list[float]) -> Stops:
    """Level, straight stops at 4 m/s, a minute apart."""
    lists = [len(value) for value in changed.values() if isinstance(value, list)]
    count = max([count, *lists])
    values: dict[str, Any] = dict.fromkeys(Stops._fields, 0.0)
    values |= {"speed": 4.0, "wave_length": 10.0, "friction": 1.0} | changed
    arrays = {name: np.resize(value, count) for name, value in values.items()}
    return Stops(**(arrays | {"clock": 60.0 * (1.0 + np.arange(count))}))


def measured(
    truth: Physics, scene: Stops, noise: float, rng: np.random.Generator
) -> sensing.Columns:
    """Drive log of stops of the plant, with this noise of the speed [m/s]."""
    late = plant_world.sampled_late(scene, rng)
    return sensing.log(drive(truth, late, sensing.sample_times(11.0)), late, noise, rng)


def decelerations(
    motion: DrivenStops, scene: Stops, at: tuple[float, float] = (0.2, 0.7)
) -> Floats:
    """Mean deceleration between two shares of the first speed [m/s²]."""
    slopes = []
    for i in range(len(scene.speed)):
        v, t = motion.speed[i], motion.time
        inside = (t > 0.0) & (v < at[1] * scene.speed[i]) & (v > at[0] * scene.speed[i])
        slopes.append(-np.polyfit(t[inside], v[inside], 1)[0])
    return np.array(slopes)
