"""Ground of the closed loop: a crop of a public elevation model, or waves.

None is steeper than the trained grades. Three surfaces lie on it in patches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter, zoom

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap

SURFACES = ("firm", "gravel", "grass")
"""Names of the surfaces in the planner's map and in the learned model."""

RESOLUTION = 0.25  # Edge of a cell [m]
MAX_GRADE = np.deg2rad(21.0)  # Steepest grade of a hill [rad]; routes keep to 20°
_SIZE = 60.0  # [m] edge of a terrain
_CELLS = int(_SIZE / RESOLUTION) + 1  # grid points of an edge
_PATCH = 8.0  # [m] size of a surface patch
_MIN_RELIEF = np.deg2rad(16.0)  # flatter crops are no test
_MAP_NOISE = 0.004  # [m] of each cell of the planner's map
_DEM_SMOOTHING = 1.0  # [m]; a one-metre model has steps and noise


@dataclass(frozen=True, slots=True)
class PhysicsGround:
    """Square ground with its lower left corner at the origin."""

    height: Floats  # heights of the grid points, row 0 at minimum y, shape (n, n) [m]
    surface: Ints  # index into :data:`SURFACES`, shape (n, n)

    @property
    def size(self) -> float:
        """Length of an edge [m]."""
        return (len(self.height) - 1) * RESOLUTION

    def surface_at(self, x: Floats, y: Floats) -> Ints:
        """Index of the surface at points, shape (k,)."""
        cells = np.clip(np.array((y, x)) / RESOLUTION + 0.5, 0.0, len(self.height) - 1)
        return np.asarray(self.surface[tuple(cells.astype(np.int64))])

    def mapped_heights(self, rng: np.random.Generator | None) -> Floats:
        """Heights of a robot's map: noisy, or exact without a generator [m]."""
        if rng is None:
            return self.height
        return self.height + rng.normal(0.0, _MAP_NOISE, self.height.shape)

    def elevation_map(self, heights: Floats) -> ElevationMap:
        """The planner's map with these heights."""
        plain = ElevationMap(elevation=heights, resolution=RESOLUTION, origin=(0.0, 0.0))
        return replace(plain, terrain_class=self.surface, class_names=SURFACES)


def hills(rng: np.random.Generator) -> PhysicsGround:
    """Waves of many lengths and directions."""
    along = RESOLUTION * np.arange(_CELLS)
    x, y = np.meshgrid(along, along)
    height = np.zeros_like(x)
    for length in np.geomspace(12.0, 60.0, 16):
        turn, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        wave = 2.0 * np.pi / length * (np.cos(turn) * x + np.sin(turn) * y) + phase
        height += length * rng.uniform(0.3, 1.0) * np.sin(wave)
    height *= np.tan(rng.uniform(_MIN_RELIEF, MAX_GRADE)) / np.tan(_max_grade(height))
    return PhysicsGround(height - height.min(), _patches(rng))


def crop(
    folder: Path, rng: np.random.Generator, part: tuple[float, float] = (0.0, 1.0)
) -> PhysicsGround:
    """Crop a hilly part of a one-metre elevation model (GeoTIFF) that is nowhere too steep.

    Surveyed heights are smoothed over a metre and interpolated by a spline.
    """
    files = sorted(folder.glob("*.tif"))
    cells = int(_SIZE) + 1
    while True:
        model = _read(files[rng.integers(len(files))])
        first, last = (int(share * len(model)) for share in part)
        row = int(rng.integers(first, last - cells))
        column = int(rng.integers(0, model.shape[1] - cells))
        piece = model[row : row + cells, column : column + cells]
        if not np.isfinite(piece).all():
            continue
        piece = gaussian_filter(piece, _DEM_SMOOTHING)
        height = zoom(piece, _CELLS / cells, order=3)
        if _MIN_RELIEF < _max_grade(height) < MAX_GRADE:
            return PhysicsGround(height - height.min(), _patches(rng))


@cache
def _read(file: Path) -> Floats:
    import rasterio

    with rasterio.open(file) as source:
        return np.asarray(source.read(1, masked=True).astype(np.float64).filled(np.nan))


def _max_grade(height: Floats) -> float:
    rise_y, rise_x = np.gradient(height, RESOLUTION)
    return float(np.arctan(np.hypot(rise_x, rise_y).max()))


def _patches(rng: np.random.Generator) -> Ints:
    """Every surface on about a third of the ground."""
    field = gaussian_filter(rng.normal(size=(_CELLS, _CELLS)), _PATCH / RESOLUTION / 2.0)
    edges = np.quantile(field, [1.0 / 3.0, 2.0 / 3.0])
    order = rng.permutation(len(SURFACES))
    return np.asarray(order[np.digitize(field, edges)], np.int64)
