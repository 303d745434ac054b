"""Ground of the closed loop: a crop of a public elevation model, waves, or an even slope.

None is steeper than the vehicle is to be trained for. Three surfaces lie on it in patches.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter, zoom

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap

SURFACES = ("firm", "gravel", "grass")
"""Names that the planner's map and the learned model share."""

RESOLUTION = 0.25
"""Edge of a cell [m]."""

STEEPEST = np.deg2rad(21.0)
"""No hill is steeper [rad]; routes keep to 20°."""

_SIZE = 60.0  # [m] edge of a terrain
_CELLS = int(_SIZE / RESOLUTION) + 1
_PATCH = 8.0  # [m] size of a surface patch
_LEAST_RELIEF = np.deg2rad(16.0)  # crops that are flatter everywhere prove nothing
_MAP_NOISE = 0.004  # [m] of each cell of the map that the planner is told
_DEM_SMOOTHING = 1.0  # [m] a one-metre model has steps and noise of its own


@dataclass(frozen=True, slots=True)
class PhysicsGround:
    """Square ground with its lower left corner at the origin.

    Attributes:
        height: (n, n) heights of the grid points [m], row 0 at minimum y.
        surface: (n, n) index into :data:`SURFACES`.
        source: where it is from.
    """

    height: Floats
    surface: Ints
    source: str

    @property
    def size(self) -> float:
        """Edge of the ground [m]."""
        return (len(self.height) - 1) * RESOLUTION

    def surface_at(self, x: Floats, y: Floats) -> Ints:
        """Index of the surface at points, (k,)."""
        last = len(self.height) - 1
        column = np.minimum(np.maximum(x / RESOLUTION + 0.5, 0.0), last).astype(np.int64)
        row = np.minimum(np.maximum(y / RESOLUTION + 0.5, 0.0), last).astype(np.int64)
        return self.surface[row, column]

    def told(self, rng: np.random.Generator | None, unknown: np.ndarray | None = None) -> Floats:
        """Heights as a robot's map has them: noisy, or exact without a generator; NaN unknown."""
        height = self.height.copy()
        if rng is not None:
            height += rng.normal(0.0, _MAP_NOISE, height.shape)
        if unknown is not None:
            height[unknown] = np.nan
        return height

    def elevation_map(self, heights: Floats) -> ElevationMap:
        """The planner's map with these heights."""
        return ElevationMap(
            elevation=heights,
            resolution=RESOLUTION,
            origin=(0.0, 0.0),
            terrain_class=self.surface,
            class_names=SURFACES,
        )


def slope(direction: float, steepness: float, rng: np.random.Generator) -> PhysicsGround:
    """An even slope that rises towards a direction [rad], with patches of every surface."""
    along = RESOLUTION * np.arange(_CELLS)
    x, y = np.meshgrid(along, along)
    height = np.tan(steepness) * (np.cos(direction) * x + np.sin(direction) * y)
    name = f"slope of {np.rad2deg(steepness):.0f}°"
    return PhysicsGround(height - height.min(), _patches(rng), name)


def hills(rng: np.random.Generator) -> PhysicsGround:
    """Waves of many lengths and directions."""
    along = RESOLUTION * np.arange(_CELLS)
    x, y = np.meshgrid(along, along)
    height = np.zeros_like(x)
    for length in np.geomspace(12.0, 60.0, 16):
        turn, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        wave = 2.0 * np.pi / length * (np.cos(turn) * x + np.sin(turn) * y) + phase
        height += length * rng.uniform(0.3, 1.0) * np.sin(wave)
    height *= np.tan(rng.uniform(_LEAST_RELIEF, STEEPEST)) / np.tan(_steepest(height))
    return PhysicsGround(height - height.min(), _patches(rng), "generated hills")


def crop(
    folder: Path, rng: np.random.Generator, part: tuple[float, float] = (0.0, 1.0)
) -> PhysicsGround:
    """A piece of a one-metre elevation model (GeoTIFF) that is hilly and nowhere too steep.

    Heights are as surveyed, smoothed over a metre and drawn out between the points by a spline.

    Args:
        folder: with elevation models. rng: draws one of them, and the place.
        part: of its rows, from and to, as shares.
    """
    files = sorted(folder.glob("*.tif"))
    cells = int(_SIZE) + 1
    while True:
        file = files[rng.integers(len(files))]
        model = _read(file)
        first, last = (int(share * len(model)) for share in part)
        row = int(rng.integers(first, last - cells))
        column = int(rng.integers(0, model.shape[1] - cells))
        piece = model[row : row + cells, column : column + cells]
        if not np.isfinite(piece).all():
            continue
        piece = gaussian_filter(piece, _DEM_SMOOTHING)
        height = zoom(piece, _CELLS / cells, order=3)
        if _LEAST_RELIEF < _steepest(height) < STEEPEST:
            source = f"{file.name} [{row}, {column}]"
            return PhysicsGround(height - height.min(), _patches(rng), source)


@cache
def _read(file: Path) -> Floats:
    import rasterio

    with rasterio.open(file) as source:
        heights = source.read(1, masked=True).astype(np.float64)
    filled: Floats = heights.filled(np.nan)
    return filled


def _steepest(height: Floats) -> float:
    rise_y, rise_x = np.gradient(height, RESOLUTION)
    return float(np.arctan(np.hypot(rise_x, rise_y).max()))


def _patches(rng: np.random.Generator) -> Ints:
    """Every surface on about a third of the ground."""
    field = gaussian_filter(rng.normal(size=(_CELLS, _CELLS)), _PATCH / RESOLUTION / 2.0)
    edges = np.quantile(field, [1.0 / 3.0, 2.0 / 3.0])
    order = rng.permutation(len(SURFACES))
    return np.asarray(order[np.digitize(field, edges)], np.int64)
