"""Estimates of the ground, put into a model that the planner reads.

Terrain parameters count with the upper end of their one-sided 95 % interval: more resistance leaves
less thrust for speeding up, a wider slip track lowers the speed that the wheels allow in turns.
Towards faster they change only where the description of the ground is certain: any other ground may
be different in the next metre.

Of braking a class determines one part only: the motion resistance that it lacks. A braking force is
brakes plus motion resistance, Braking (6), so on ground that rolls more easily than the ground of
the coefficients, the force is less by the difference. Ground that rolls harder gets no credit:
whether the brakes hold as well on it only stops can show. Source: Braking (6).

Where the brakes are applied in part only, the motion resistance is a part of the braking force, and
more of it would be stronger brakes. There the upper end for the drive does not count: braking uses
the f_r that it had, or the lower one that was measured, and the difference between that and the
drive's is scatter of the force. A vehicle that rolls on downhill while its brakes build up counts
on the lower end with full brakes, and on that estimate where they are applied in part.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking, Model, Terrain
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.surface_names import states_of
from slopewise.models.terrain.observation import Features, TerrainEstimate

UPPER = 1.645
"""Standard deviations of a normal distribution below which 95 % lie [1]."""


def model_on(model: Model, known: Features, *, valid: bool = True) -> Model:
    """The model with the terrain parameters of the ground driven now.

    A larger standard deviation never shortens a stop and never raises a speed. Unknown estimates
    change nothing. ``valid``: the description is as certain as plans rely on; if not, no parameter
    becomes faster, but less motion resistance to brake with still counts.
    """
    old, measured = model.terrain, known.motion_resistance
    lowest = {
        "motion_resistance": 0.0,
        "lateral_resistance": 0.0,
        "slip_track": model.vehicle.track_width,
    }
    news = {}
    for name, floor in lowest.items():
        estimate, before = getattr(known, name), getattr(old, name)
        upper = estimate.value + UPPER * estimate.std
        use = math.isfinite(upper) and (valid or upper >= before)
        news[name] = max(upper if use else before, floor)
    terrain = dataclasses.replace(old, **news)
    if not measured.is_known:
        return dataclasses.replace(model, terrain=terrain)
    # Below level 1 the scatter of the force includes that of f_r; at level 1 only rolling has it.
    lower = measured.value - (UPPER * measured.std if model.braking.level == 1.0 else 0.0)
    resistance = max(min(old.rolling_while_braking, lower), 0.0)
    terrain = dataclasses.replace(terrain, braking_resistance=resistance)
    braking = _with_scatter(model.braking, _open(old), _open(terrain))
    return dataclasses.replace(model, terrain=terrain, braking=braking)


def _open(terrain: Terrain) -> float:
    """Range of f_r [1] from the lowest, which braking counts on, to the highest."""
    return terrain.motion_resistance - terrain.rolling_while_braking


def _with_scatter(braking: Braking, before: float, now: float) -> Braking:
    """Brakes whose scatter includes the range of f_r beyond the one that it had."""
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


def with_surface(
    model: Model, name: str, motion_resistance: TerrainEstimate, reference: float
) -> Model:
    """The model with a table of braking for a named ground, unless it has one from stops.

    ``reference``: f_r of the ground that the braking coefficients were learned on. ParameterError
    if there is so little resistance that the brakes would not stop the vehicle.
    """
    if name in model.braking.terrain:
        return model
    lowest = motion_resistance.value - motion_resistance.std
    lacking = max(reference - lowest, 0.0) if math.isfinite(lowest) else 0.0
    number = _free_number(model.braking.terrain)
    table = SurfaceBraking(b_b=model.braking.b_b - lacking, class_id=number)
    try:
        braking = dataclasses.replace(model.braking, terrain={**model.braking.terrain, name: table})
    except ParameterError as error:
        expected = f"{error.expected}: f_r is {lacking:.2f} less than where it was learned"
        raise ParameterError(f"braking.{error.field}", expected) from None
    return dataclasses.replace(model, braking=braking)


def with_open_surfaces(model: Model, names: Collection[str]) -> Model:
    """The model whose base may turn out to be any of the named surfaces.

    Plans then use the weakest of the base and these; surfaces that a map names are unchanged, so
    that no description of the ground, right or wrong, makes a plan faster than none.
    """
    tables = dict(model.braking.terrain)
    for name in [name for name in tables if name in names]:
        for state in states_of(tables, name):
            number = _free_number(tables)
            table = dataclasses.replace(tables[state], state_of="", class_id=number)
            tables[f"{state} of {name}"] = table
        if tables[name].state_of is None:
            tables[name] = dataclasses.replace(tables[name], state_of="")
    if tables == dict(model.braking.terrain):
        return model
    return dataclasses.replace(model, braking=dataclasses.replace(model.braking, terrain=tables))


def _free_number(tables: Mapping[str, SurfaceBraking]) -> int:
    """Number that no table has, behind the places by which those without one are numbered."""
    used = {table.class_id for table in tables.values()}
    return next(i for i in range(len(tables) + 1, 2 * len(tables) + 2) if i not in used)
