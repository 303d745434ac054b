"""A map in tiles and files of paths for the tests of a fleet."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import rasterio
from rasterio.transform import from_origin

from slopewise.services.fleet.plan_part import PlanTask, plan_part

RESOLUTION = 0.5


def tiled_map(path: Path, rows: int = 512, columns: int = 512) -> Path:
    """Gentle waves, an unknown hollow, and an unknown corner in the north-east; origin at 0, 0."""
    y, x = np.mgrid[0:rows, 0:columns] * RESOLUTION
    height = 0.8 * np.sin(x / 9.0) + 0.6 * np.cos(y / 7.0)
    height[np.hypot(x - 60.0, y - 60.0) < 4.0] = -9999.0
    height[(x > 170.0) & (y > 170.0)] = -9999.0
    north = rows * RESOLUTION - 0.5 * RESOLUTION
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        width=columns,
        height=rows,
        count=1,
        dtype="float32",
        crs="EPSG:32633",
        nodata=-9999.0,
        tiled=True,
        blockxsize=128,
        blockysize=128,
        transform=from_origin(-0.5 * RESOLUTION, north, RESOLUTION, RESOLUTION),
    ) as dataset:
        dataset.write(height[::-1].astype(np.float32), 1)
    return path


def paths_file(path: Path, count: int, seed: int) -> Path:
    """Arcs from anywhere on the map to anywhere near, as CSV or Parquet."""
    rng = np.random.default_rng(seed)
    along = np.arange(0.0, 20.0, 1.0)
    columns: dict[str, list] = {"x": [], "y": [], "candidate": []}
    for number in range(count):
        heading = rng.uniform(-np.pi, np.pi) + rng.uniform(-0.03, 0.03) * along
        start = rng.uniform(30.0, 220.0, 2)
        columns["x"] += (start[0] + np.cumsum(np.cos(heading))).tolist()
        columns["y"] += (start[1] + np.cumsum(np.sin(heading))).tolist()
        columns["candidate"] += [f"{path.stem}.{number}"] * len(along)
    if path.suffix == ".parquet":
        import pyarrow.parquet

        pyarrow.parquet.write_table(pyarrow.table(columns), path)
        return path
    rows = zip(*columns.values(), strict=True)
    path.write_text("x,y,candidate\n" + "".join(f"{x!r},{y!r},{c}\n" for x, y, c in rows))
    return path


def slow_part(task: PlanTask) -> int:
    """As a part takes longer in earnest: there is time to die in the middle."""
    time.sleep(0.4)
    return plan_part(task)
