"""Bounds taken away, one at a time: what a plan would be without them.

A model with a limit lifted stays a valid model. Loads are lifted by geometry: an axle far from the
centre of gravity is never unloaded. The terrain under the wheels is sampled before, with the true
footprint, and the turning drag keeps its value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from slopewise.models.parameters import Model
from slopewise.models.steering import Steering
from slopewise.planner.explain.what_if import Assumptions
from slopewise.planner.limiting import BOUNDS, Limiting

_FAR = 1e3
"""Factor by which a limit, or a distance to the centre of gravity, is out of reach."""

_ANY_GRADE = (-1.5, 1.5)
"""Grades of a model that is valid everywhere [rad]: nearly vertical."""


def without(bound: Limiting, assumptions: Assumptions) -> Assumptions:
    """The assumptions with one bound lifted, as its entry in the registry of bounds says."""
    lift = BOUNDS[bound].lift
    relax = _RELAXATIONS.get(lift.relaxation)
    if lift.out_of_reach:
        relax = _out_of_reach(lift.out_of_reach)
    changes: dict[str, Any] = dict(lift.assumptions)
    if lift.of_hazards:
        changes["lifted"] = (bound,)
    if changes.pop("trained_everywhere", False):
        changes["model"] = trained_for(assumptions.model, grades=True, speeds=True)
    return replace(assumptions, relax=relax or assumptions.relax, **changes)


def trained_for(model: Model, *, grades: bool = False, speeds: bool = False) -> Model:
    """The same coefficients, trained on every grade, or up to the speed limit, on all surfaces."""

    def changes(speed_range: tuple[float, float]) -> dict[str, Any]:
        out: dict[str, Any] = {"grade_range": _ANY_GRADE} if grades else {}
        if grades or speeds:
            out["speed_by_grade"] = None
        if speeds:
            out["speed_range"] = (speed_range[0], max(speed_range[1], model.limits.speed))
        return out

    base = model.braking
    surfaces = {
        name: replace(table, **changes(table.speed_range or base.speed_range))
        for name, table in base.terrain.items()
    }
    return replace(model, braking=replace(base, terrain=surfaces, **changes(base.speed_range)))


def _as_fast_as_trained(model: Model) -> Model:
    """No speed limit up to the trained speeds; beyond them another bound holds."""
    base = model.braking
    ranges = [table.speed_range or base.speed_range for table in base.terrain.values()]
    top = max(fast for _, fast in (base.speed_range, *ranges))
    return replace(model, limits=replace(model.limits, speed=max(model.limits.speed, top)))


def _any_friction(model: Model) -> Model:
    """Ground of unknown friction, which bounds nothing."""
    base = model.braking
    surfaces = {n: replace(t, sliding_friction=None) for n, t in base.terrain.items()}
    return replace(model, braking=replace(base, sliding_friction=None, terrain=surfaces))


def _any_turn(model: Model) -> Model:
    """Steering as tight as any path, and as quick; the body stands on the path as before."""
    kind = model.vehicle.drive
    given = Steering(kind=kind) if model.steering is None else model.steering
    free = replace(given, max_angle=None, min_radius=1.0 / _FAR, max_rate=None)
    return replace(model, steering=free)


def _stretched(model: Model, factor: float, cg_z: float) -> Model:
    v, terrain = model.vehicle, model.terrain
    vehicle = replace(v, cg_z=cg_z, cg_x=v.cg_x * factor, wheelbase=v.wheelbase * factor)
    drag = replace(terrain, lateral_resistance=terrain.lateral_resistance / factor)
    return replace(model, vehicle=vehicle, terrain=drag)


def _out_of_reach(limits: tuple[str, ...]) -> Callable[[Model], Model]:
    def relax(model: Model) -> Model:
        for limit in limits:
            table, name = limit.split(".")
            part: Any = getattr(model, table)
            changed: dict[str, Any] = {table: replace(part, **{name: _FAR * getattr(part, name)})}
            model = replace(model, **changed)
        return model

    return relax


_RELAXATIONS: Mapping[str, Callable[[Model], Model]] = {
    "as_fast_as_trained": _as_fast_as_trained,
    "any_friction": _any_friction,
    "any_turn": _any_turn,
    "far_axles": lambda m: _stretched(m, _FAR, m.vehicle.cg_z),
    # A low centre of gravity, and axles nearer in the same proportion, so that they count on.
    "far_sides": lambda m: _stretched(m, 1.0 / _FAR, m.vehicle.cg_z / _FAR),
}
