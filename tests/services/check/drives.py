"""Ground and plans that were never planned: straight and round drives over simple surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.services.check.external_plan import ExternalPlan
from tests.world.vehicles import model_of, tables_with

Surface = Callable[[np.ndarray, np.ndarray], np.ndarray]
Columns = Callable[[np.ndarray, np.ndarray], dict[str, np.ndarray]]


def model_with(**tables: Mapping[str, Any]) -> Model:
    """The quad with other numbers; held speed in the dead time by default."""
    out = tables_with()
    out["braking"]["drive_in_dead_time"] = "held"
    for table, values in tables.items():
        if table == "effect":
            out[table] = values
        else:
            out.setdefault(table, {}).update(values)
    return model_of(out)


def ground(
    surface: Surface | None = None, *, resolution: float = 0.2, size: float = 30.0, **layers: Any
) -> ElevationMap:
    """Heights of a surface over x −5 … size and y −10 … 10; level by default."""
    x = np.arange(-5.0, size + resolution, resolution)
    y = np.arange(-10.0, 10.0 + resolution, resolution)
    heights = np.zeros((len(y), len(x))) if surface is None else surface(*np.meshgrid(x, y))
    return ElevationMap(elevation=heights, resolution=resolution, origin=(-5.0, -10.0), **layers)


def slope(grade: float = 0.0, roll: float = 0.0) -> Surface:
    """A plane; roll is left side up, for a vehicle that drives along x."""
    return lambda x, y: np.tan(grade) * x + np.tan(roll) / np.cos(grade) * y


def trapezoid(
    top: float,
    *,
    accel: float = 0.9,
    decel: float | None = None,
    length: float = 20.0,
    stop_at: float = 17.0,
    spacing: float = 0.1,
    begin: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Stations and speeds of a drive from one speed to a top speed, and to rest."""
    s = np.linspace(0.0, length, round(length / spacing) + 1)
    slowing = accel if decel is None else decel
    up = begin**2 + 2.0 * accel * s
    down = 2.0 * slowing * np.maximum(stop_at - s, 0.0)
    return s, np.sqrt(np.minimum(np.minimum(up, down), top**2))


def straight(s: np.ndarray, speed: np.ndarray, **columns: Any) -> ExternalPlan:
    """Along x from the origin."""
    return ExternalPlan(name="straight", x=s, y=np.zeros_like(s), speed=speed, **columns)


def round_turn(s: np.ndarray, speed: np.ndarray, radius: float, **columns: Any) -> ExternalPlan:
    """A left turn that begins along x at the origin."""
    x, y = radius * np.sin(s / radius), radius * (1.0 - np.cos(s / radius))
    return ExternalPlan(name="turn", x=x, y=y, speed=speed, **columns)


class Scene(NamedTuple):
    """A plan that uses a share of what one rule allows."""

    plan: ExternalPlan
    model: Model
    heights: ElevationMap
    clear: float = np.inf
    quantile: float = 0.5


def driven(
    top: float,
    surface: Surface | None = None,
    *,
    radius: float | None = None,
    resolution: float = 0.2,
    clear: float = np.inf,
    quantile: float = 0.5,
    columns: Columns | None = None,
    shape: Mapping[str, float] = MappingProxyType({}),
    **tables: Mapping[str, Any],
) -> Scene:
    """A straight drive, or a left turn, with a model of changed tables.

    ``columns`` gives further columns of a plan by its stations and speeds, ``shape`` what is not
    the default of a trapezoid.
    """
    s, v = trapezoid(top, **shape)
    further = {} if columns is None else columns(s, v)
    plan = straight(s, v, **further) if radius is None else round_turn(s, v, radius, **further)
    heights = ground(surface, resolution=resolution)
    return Scene(plan, model_with(**tables), heights, clear, quantile)


def at(place: Surface, height: float) -> Surface:
    """Ground of one height, or unknown, where a condition holds, and level elsewhere."""
    return lambda x, y: np.where(place(x, y), height, 0.0)


def hill(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Rounded with a radius of 6 m, ±0.2 rad on both sides."""
    along = np.abs(x - 8.0)
    return -np.where(along < 1.2, along**2 / 12.0, 0.12 + 0.2 * (along - 1.2)) + 0.0 * y


def constant_force(b_b: float, b_m: float = 0.0) -> dict[str, float]:
    return {"m_m": 0.0, "b_m": b_m, "m_b": 0.0, "b_b": b_b}
