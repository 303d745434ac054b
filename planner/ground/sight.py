"""How fast a vehicle may go where noise of the map hides steps that it cannot climb."""

from __future__ import annotations

from dataclasses import replace

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.smallest_seen import careful_speed, hides_steps, smallest_seen
from slopewise.planner.settings import UnseenSteps

_CACHE_SIZE = 4
"""Models that are cached [1]: of one map in use, the next, and those of two comparisons."""

_recent: tuple[tuple[Model, Model], ...] = ()
"""Given ones and slower ones; replaced as a whole, never changed: threads need no lock."""


def within_sight(model: Model, elevation_map: ElevationMap, unseen_steps: UnseenSteps) -> Model:
    """The model with a speed limit that this map allows; the same object for the same model."""
    global _recent
    if unseen_steps == "report" or not hides_steps(
        smallest_seen(elevation_map, model.vehicle), model.vehicle
    ):
        return model
    limits = model.limits
    speed = careful_speed(model.vehicle.wheel_radius, limits.vertical_accel)
    if limits.speed <= speed:
        return model
    for given, slower in _recent:
        if given is model:
            return slower
    slower = replace(model, limits=replace(limits, speed=speed))
    _recent = ((model, slower), *_recent[: _CACHE_SIZE - 1])
    return slower
