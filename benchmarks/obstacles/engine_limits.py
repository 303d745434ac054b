"""Limits of a vehicle in the physics engine, measured as those of a real one.

Sizes that a model file derives from the wheel radius are careful guesses. Before obstacles are
driven, each vehicle drives over steps up and down and over a long rock under its left wheels, on
level ground, square on and at the speeds of a plan, higher from drive to drive. The last heights
without a failure are its limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status

from .cases import LENGTH
from .obstacle_drive import drive
from .shapes import FAR, Block, Slope

_FIRST, _LAST, _FINER = 0.1, 1.0, 0.02
"""Range and step of the tried heights over the wheel radius [1]."""

_LEVEL = Slope(0.0, 0.0)
"""Level ground: grade and roll [rad]."""
_CELL = 0.1  # [m] of the map


def measured_in_engine(model: Model) -> Model:
    """The model with the highest step and the travel of a wheel that the engine's vehicle has."""
    plan = plan_on_level_ground(model)
    vehicle = model.vehicle

    def passes(block: Block) -> bool:
        return not drive(block, _LEVEL, model, plan).failed

    up = _highest(vehicle.wheel_radius, lambda h: passes(Block(FAR, 0, 0, FAR, 2 * FAR, h)))
    down = _highest(vehicle.wheel_radius, lambda h: passes(Block(FAR, 0, 0, FAR, 2 * FAR, -h)))
    long, side = 1.5 * vehicle.wheelbase, 0.5 * vehicle.track_width
    width = vehicle.shape.wheel_width
    rock = _highest(vehicle.wheel_radius, lambda h: passes(Block(0, side, 0, long, width, h)))
    step = min(up, down)
    limited = replace(vehicle, max_step=step, wheel_travel=min(rock, step))
    return replace(model, vehicle=limited)


def plan_on_level_ground(model: Model) -> SpeedPlan:
    half = 0.5 * LENGTH * model.vehicle.wheelbase
    cells = int((4.0 * half) / _CELL)
    level = ElevationMap(
        elevation=np.zeros((cells, cells)), resolution=_CELL, origin=(-2.0 * half, -2.0 * half)
    )
    path = CandidatePath("over it", np.array([[-half, 0.0], [half, 0.0]]))
    (plan,) = CandidatePlanner(model).plan(level, [path])
    if plan.status is not Status.OK:
        raise AssertionError(f"no plan on level ground: {plan.reason}")
    return plan


def _highest(radius: float, passes: Callable[[float], bool]) -> float:
    """The last height before the first that fails [m]."""
    passed = _FIRST * radius
    for height in radius * np.arange(_FIRST, _LAST, _FINER):
        if not passes(float(height)):
            break
        passed = float(height)
    return passed
