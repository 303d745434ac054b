"""What was learned of the ground, put into a model that the planner reads.

Terrain parameters are rounded towards slower by their standard deviation: more resistance leaves
less thrust for speeding up, a wider slip track lowers the speed that the wheels allow in turns.
Towards faster they go on ground of a known class only: what is none of these may be anything in the
next metre, and is given no credit for what was measured in the last.

Of braking a class tells one thing only: the motion resistance that it lacks. A braking force is
brakes plus motion resistance, Braking (6), so on ground that rolls more easily than the ground the
coefficients are of, the force is less by the difference. Ground that rolls harder is given no
credit: whether the brakes hold as well on it only stops can tell. Source: Braking (6).

Where the brakes are applied in part only, the motion resistance is a part of the braking force, and
more of it would be stronger brakes. There what is rounded up for the drive does not count: braking
keeps the f_r that it had, or the lower one that was found, and what is open between that and the
one for the drive is scatter of the force.
"""

from __future__ import annotations

import dataclasses
import math

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking, Model, Terrain
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.terrain.observation import UNKNOWN, Features
from slopewise.models.terrain.resistances import TerrainEstimate


def model_on(model: Model, known: Features, *, valid: bool = True) -> Model:
    """The model with the terrain parameters of the ground driven now.

    A larger standard deviation never shortens a stop and never raises a speed.

    Args:
        model: as it was.
        known: latest estimates; what is not known stays as it was.
        valid: the ground is of a known class; if not, no parameter becomes faster. Less motion
            resistance to brake with counts all the same.
    """
    old, found = model.terrain, known.motion_resistance
    if not valid:
        known = _none_faster(known, old)
    wide = _slower(known.slip_track, old.slip_track)
    terrain = dataclasses.replace(
        old,
        motion_resistance=max(_slower(known.motion_resistance, old.motion_resistance), 0.0),
        lateral_resistance=max(_slower(known.lateral_resistance, old.lateral_resistance), 0.0),
        slip_track=max(wide, model.vehicle.track_width),
    )
    if model.braking.level == 1.0 or not math.isfinite(found.value + found.std):
        return dataclasses.replace(model, terrain=terrain)
    kept = max(min(old.rolling_while_braking, found.value), 0.0)
    terrain = dataclasses.replace(terrain, braking_resistance=kept)
    braking = _with_scatter(model.braking, _open(old), _open(terrain))
    return dataclasses.replace(model, terrain=terrain, braking=braking)


def _none_faster(known: Features, old: Terrain) -> Features:
    """Estimates without those that, rounded, are faster than what was taken so far."""
    before = (old.motion_resistance, old.lateral_resistance, old.slip_track)
    estimates = (known.motion_resistance, known.lateral_resistance, known.slip_track)
    kept = [
        UNKNOWN if found.value + found.std < value else found
        for found, value in zip(estimates, before, strict=True)
    ]
    return Features(*kept)


def _open(terrain: Terrain) -> float:
    """What is not known of f_r [1]: from the least, which braking counts on, to the most."""
    return terrain.motion_resistance - terrain.rolling_while_braking


def _with_scatter(braking: Braking, before: float, now: float) -> Braking:
    """Brakes that scatter by what is open of f_r beyond what they scatter by already."""
    more = (1.0 - braking.share_at()) ** 2 * max(now**2 - before**2, 0.0)

    def wider(force_std: float) -> float:
        return math.sqrt(force_std**2 + more)

    tables = {
        name: table
        if table.force_std is None
        else dataclasses.replace(table, force_std=wider(table.force_std))
        for name, table in braking.terrain.items()
    }
    return dataclasses.replace(braking, force_std=wider(braking.force_std), terrain=tables)


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
