"""Discs on rolling ground: trees, unknown patches and holes, and their map."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slopewise.models.elevation_map import ElevationMap

from .hard_swerves import Swerve, obstacle_off_arc, run_without_guard
from .moving_base import MovingBase
from .relief import Relief

EDGE = 26.0  # of the map [m]
_HEIGHTS = {"tree": 1.5, "unknown": math.nan, "hole": -0.8}  # of discs above the ground [m]
_NEXT_TO = 0.6  # distance of unknown ground from a turn: two cells and the errors of a pose [m]
_CORRIDOR = 0.3  # free on each side of the run of a swerve that has one obstacle only [m]


@dataclass(frozen=True)
class ObstacleWorld:
    """Discs (D,) and the map that shows them."""

    x: np.ndarray
    y: np.ndarray
    radius: np.ndarray
    what: np.ndarray
    ground: ElevationMap

    def hit(self, base: MovingBase) -> str:
        """Obstacle that the body overlaps, or in which a wheel stands."""
        at = self.x, self.y, self.radius
        hit = np.where(self.what == "hole", base.wheels_in(*at), base.overlaps(*at))
        return str(self.what[int(np.argmax(hit))]) if hit.any() else ""


def draw_world(
    rng: np.random.Generator, base: MovingBase, kind: str, swerve: Swerve | None
) -> ObstacleWorld:
    """Discs, none where the base stands; cells of 0.1 or 0.2 m, with a stated noise or exact."""
    count = int(rng.integers(*(3, 20) if kind == "slope" else (20, 100)))
    x, y = rng.uniform(1.0, EDGE - 1.0, (2, count))
    what = rng.choice(["tree", "unknown", "hole"], count, p=(0.7, 0.15, 0.15))
    radius = rng.uniform(np.where(what == "hole", 0.3, 0.08), 0.4)
    if kind == "pivot":
        # Some are where the corners pass.
        near, size = int(rng.integers(1, 6)), base.vehicle.shape
        angle = rng.uniform(0.0, 2.0 * np.pi, near)
        reach = rng.uniform(0.7, 1.2 + max(size.front, size.rear), near)
        x[:near], y[:near] = base.x + reach * np.cos(angle), base.y + reach * np.sin(angle)
        radius[:near] = np.minimum(radius[:near], 0.3)
    free = ~base.overlaps(x, y, radius + float(rng.uniform(0.02, 0.3)))
    if kind == "pivot":
        # A turn on the spot may enter unknown ground that is next to the body, by a cell.
        free &= (what != "unknown") | ~base.overlaps(x, y, radius + _NEXT_TO)
    if swerve is not None:
        for state in run_without_guard(base, swerve, brakes=True)[::5]:
            free &= ~state.overlaps(x, y, radius + _CORRIDOR)
        x[0], y[0], radius[0] = obstacle_off_arc(rng, base, swerve)
        what[0], free[0] = "tree", True
    discs = x[free], y[free], radius[free], what[free]
    cell, noise = rng.choice([0.1, 0.2], p=(0.75, 0.25)), 0.0
    if cell <= base.vehicle.wheel_radius and rng.random() < 0.25:
        noise = float(rng.uniform(0.005, 0.03))
    z = _heights(base.relief, float(cell), *discs)
    z += noise * rng.standard_normal(z.shape)
    ground = ElevationMap(elevation=z, resolution=float(cell), origin=(0.0, 0.0), height_std=noise)
    return ObstacleWorld(*discs, ground)


def _heights(
    relief: Relief,
    cell: float,
    x: np.ndarray,
    y: np.ndarray,
    radius: np.ndarray,
    what: np.ndarray,
) -> np.ndarray:
    """Cells of the map: a disc raises or lowers every cell whose square it touches [m]."""
    at = cell * np.arange(round(EDGE / cell) + 1)
    z = relief.at(*np.meshgrid(at, at))
    for east, north, size, kind in zip(x, y, radius, what, strict=True):
        dx = np.maximum(np.abs(at - east) - 0.5 * cell, 0.0)
        dy = np.maximum(np.abs(at - north) - 0.5 * cell, 0.0)[:, None]
        touched = np.hypot(dx, dy) <= size
        level = float(relief.at(np.array(east), np.array(north)))
        z[touched] = level + _HEIGHTS[str(kind)]
    return z
