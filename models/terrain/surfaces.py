"""What was learned of the ground, put into a model that the planner reads.

Terrain parameters are rounded towards slower by their standard deviation: more resistance leaves
less thrust for speeding up, a wider slip track lowers the speed that the wheels allow in turns.

Of braking a class tells one thing only: the motion resistance that it lacks. A braking force is
brakes plus motion resistance, Braking (6), so on ground that rolls more easily than the ground the
coefficients are of, the force is less by the difference. Ground that rolls harder is given no
credit: whether the brakes hold as well on it only stops can tell. Source: Braking (6).
"""

from __future__ import annotations

import dataclasses
import math

from models.errors import ParameterError
from models.parameters import Model, Terrain
from models.surface_braking import SurfaceBraking
from models.terrain.observation import Features
from models.terrain.resistances import TerrainEstimate


def model_on(model: Model, known: Features) -> Model:
    """The model with the terrain parameters of the ground driven now.

    Args:
        model: as it was.
        known: latest estimates; what is not known stays as it was.
    """
    old = model.terrain
    wide = _slower(known.slip_track, old.slip_track)
    terrain = Terrain(
        motion_resistance=max(_slower(known.motion_resistance, old.motion_resistance), 0.0),
        lateral_resistance=max(_slower(known.lateral_resistance, old.lateral_resistance), 0.0),
        slip_track=max(wide, model.vehicle.track_width),
    )
    return dataclasses.replace(model, terrain=terrain)


def _slower(found: TerrainEstimate, otherwise: float) -> float:
    value = found.value + found.std
    return value if math.isfinite(value) else otherwise


def with_surface(
    model: Model, name: str, motion_resistance: TerrainEstimate, reference: float
) -> Model:
    """The model with a table of braking for a class of terrain, unless it has one.

    A table that is there was learned from stops, and knows better.

    Args:
        model: as it was; its braking coefficients belong to ``reference``.
        name: of the class.
        motion_resistance: f_r of the class.
        reference: f_r of the ground that the braking coefficients were learned on.

    Raises:
        ParameterError: so little resistance that the brakes would not stop it.
    """
    if name in model.braking.terrain:
        return model
    least = motion_resistance.value - motion_resistance.std
    lacking = max(reference - least, 0.0) if math.isfinite(least) else 0.0
    tables = model.braking.terrain
    # a table without a number is found by its place, so numbers begin behind the last place
    taken = {given.class_id for given in tables.values()}
    number = next(i for i in range(len(tables) + 1, 2 * len(tables) + 2) if i not in taken)
    table = SurfaceBraking(b_b=model.braking.b_b - lacking, class_id=number)
    try:
        braking = dataclasses.replace(model.braking, terrain={**model.braking.terrain, name: table})
    except ParameterError as error:
        words = f"{error.expected}: f_r is {lacking:.2f} less than where it was learned"
        raise ParameterError(f"braking.{error.field}", words) from None
    return dataclasses.replace(model, braking=braking)
