"""How fast a vehicle may go where noise of the map hides steps that it cannot climb."""

from __future__ import annotations

from dataclasses import replace

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.recent import Recent
from slopewise.models.smallest_seen import careful_speed, hides_steps
from slopewise.planner.settings import UnseenSteps

_careful: Recent[Model] = Recent()


def within_sight(model: Model, elevation_map: ElevationMap, unseen_steps: UnseenSteps) -> Model:
    """The model with a speed limit that this map allows; the same object for the same model."""
    if unseen_steps == "report" or not hides_steps(elevation_map, model.vehicle):
        return model
    limits = model.limits
    speed = careful_speed(model.vehicle.wheel_radius, limits.vertical_accel)
    if limits.speed <= speed:
        return model
    return _careful.get(lambda: replace(model, limits=replace(limits, speed=speed)), model)
