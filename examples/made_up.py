"""Write a generated map, paths and drive log, to try the commands of README with.

python examples/made_up.py [FOLDER]

The ground is rolling hills on a UTM grid. The vehicle of the log brakes with 0.40 of its weight on
level ground and a little less uphill, 0.30 s after the command; stops scatter by 1 %.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import rasterio
from rasterio.transform import from_origin

from slopewise import CandidatePath
from slopewise.models.arrays import Floats
from slopewise.services.io.path_file import write_paths_csv
from slopewise.services.io.table import write_csv

GRAVITY = 9.80665
EAST, NORTH = 500_000.0, 5_000_000.0  # [m] the map's north-western corner
CELLS = 120  # of 1 m
DEAD_TIME, RATE = 0.30, 50.0  # [s], [Hz]


def hills() -> Floats:
    """Heights, the northernmost row first [m]."""
    x, y = np.meshgrid(np.arange(CELLS), np.arange(CELLS))
    return 3.0 * np.sin(x / 12.0) + 2.2 * np.cos(y / 10.0)


def write_map(file: Path) -> None:
    """The hills as a GeoTIFF."""
    with rasterio.open(
        file,
        "w",
        driver="GTiff",
        width=CELLS,
        height=CELLS,
        count=1,
        dtype="float32",
        crs="EPSG:32632",
        transform=from_origin(EAST, NORTH, 1.0, 1.0),
    ) as dataset:
        dataset.write(hills().astype(np.float32), 1)


def paths() -> list[CandidatePath]:
    """Three ways eastwards from the same place."""
    along = np.linspace(0.0, 40.0, 81)
    start = np.array((EAST + 40.0, NORTH - 60.0))
    return [
        CandidatePath(name, start + np.stack((along, half_curvature * along**2), axis=1))
        for name, half_curvature in (("left", 0.006), ("straight", 0.0), ("right", -0.006))
    ]


def stops(count: int = 30, seed: int = 0) -> dict[str, Floats]:
    """A drive log with full stops up and down slopes of up to 14°, on one clock."""
    random = np.random.default_rng(seed)
    parts, clock = [], 0.0
    for run in range(count):
        speed, grade = random.uniform(1.0, 4.0), random.uniform(-0.25, 0.25)
        force = (0.40 - 0.2 * grade) * random.normal(1.0, 0.01)
        slowing = GRAVITY * (force + np.sin(grade))
        t = np.arange(-1.5, DEAD_TIME + speed / slowing + 1.5, 1.0 / RATE)
        v = np.clip(speed - slowing * np.maximum(t - DEAD_TIME, 0.0), 0.0, None)
        commanded = np.where(t < 0.0, speed, 0.0)
        pitch = -grade + random.normal(0.0, 0.004, t.size)
        noisy = v + random.normal(0.0, 0.02, t.size) * (v > 0.0)
        parts.append(np.stack((np.full(t.size, run), clock + t, noisy, commanded, pitch)))
        clock += t[-1] + 3.0
    return dict(zip(("run", "t", "v", "v_cmd", "pitch"), np.hstack(parts), strict=True))


def main(folder: Path) -> None:
    """Write dem.tif, paths.csv and drive.csv."""
    folder.mkdir(parents=True, exist_ok=True)
    write_map(folder / "dem.tif")
    write_paths_csv(paths(), folder / "paths.csv")
    log = stops()
    runs = [f"{run:.0f}" for run in log.pop("run")]
    write_csv({"run": runs, **log}, folder / "drive.csv")


if __name__ == "__main__":
    main(Path(*sys.argv[1:]))
