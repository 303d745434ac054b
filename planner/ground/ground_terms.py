"""Braking force that effects of the ground add around each station."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Place
from slopewise.models.parameters import Model
from slopewise.planner.ground.terrain_profile import TerrainProfile

_SLOWEST, _STOP = 0.25, 15.0
"""Mean speed of the slowest plan [m/s] and its longest stop [s]: how late it is at a station."""

_EDGE_STEP = 0.01
"""Distances between stations are rounded up to this [m]: paths alike share one circle."""


def ground_terms(
    model: Model, profile: TerrainProfile, yaw: Floats, session_time: float
) -> tuple[Floats, Floats]:
    """Lowest and highest that the ground terms can be around each station, (N, M).

    Terms that bend where grade or roll change sign are zero in between. What has a sharp edge may
    lie between two stations: it counts as larger by a step of the path where that is the safe side,
    and for the neighbours as well. What changes with time counts from now until the vehicle has
    passed and stopped, however slowly.
    """
    place = Place(profile.grade, profile.roll, profile.x, profile.y, yaw, session_time)
    low, high = np.zeros_like(profile.grade), np.zeros_like(profile.grade)
    steps = np.ceil(np.max(np.diff(profile.station, axis=0), axis=0) / _EDGE_STEP) * _EDGE_STEP
    for effect in model.effect:
        law = registry.LAWS[effect.name]
        here = registry.ground_term([effect], place)
        lowest, highest = here, here
        if "session_time" in law.depends_on:
            late = session_time + profile.station / _SLOWEST + _STOP
            later = registry.ground_term([effect], place._replace(session_time=late))
            lowest, highest = np.minimum(here, later), np.maximum(here, later)
        if law.kinks_at_level:
            grade, roll = (level_between(slope) for slope in (profile.grade, profile.roll))
            level = registry.ground_term([effect], place._replace(grade=grade, roll=roll))
            lowest, highest = np.minimum(here, level), np.maximum(here, level)
        elif law.grown is not None:
            near = np.empty_like(here)
            for step in np.unique(steps):
                grown = [replace(effect, parameters=law.grown(effect.parameters, float(step)))]
                same_step = steps == step
                columns = (v[:, same_step] if isinstance(v, np.ndarray) else v for v in place)
                near[:, same_step] = registry.ground_term(grown, Place(*columns))
            lowest, _ = spread_to_neighbours(np.minimum(here, near))
            _, highest = spread_to_neighbours(np.maximum(here, near))
        low, high = low + lowest, high + highest
    return low, high


def level_between(slope: Floats) -> Floats:
    """The slope, but level where it changes sign on the way to a neighbour, (N, M) [rad]."""
    lowest, highest = spread_to_neighbours(slope)
    return np.where((lowest < 0.0) & (highest > 0.0), 0.0, slope)


def spread_to_neighbours(term: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest value among each station and its neighbours."""
    padded = np.pad(term, ((1, 1), (0, 0)), mode="edge")
    stack = np.stack((padded[:-2], term, padded[2:]))
    return stack.min(axis=0), stack.max(axis=0)
