"""A generated hillside with a fan of candidate paths, planned."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.services.io.map_file import write_map_npz
from slopewise.services.io.path_file import write_paths_csv
from slopewise.services.jobs.plan import PlanResult, plan
from slopewise.services.jobs.plan_files import write_plans

RESOLUTION = 0.2  # [m]
MODEL, START_SPEED = "atv", 1.5  # [m/s]
_SIZE = (60.0, 48.0)  # [m] east, north
_START = (6.0, 24.0)  # [m] of all paths


def demo(folder: Path) -> tuple[PlanResult, Path, Path]:
    """Write map.npz, paths.csv and plan.csv; the result, and the files of map and paths."""
    folder.mkdir(parents=True, exist_ok=True)
    map_file, path_file = folder / "map.npz", folder / "paths.csv"
    write_map_npz(hillside(), map_file)
    write_paths_csv(fan(), path_file)
    result = plan(map_file, path_file, MODEL, start_speed=START_SPEED, uncertainty=Uncertainty())
    write_plans(result, folder / "plan.csv")
    return result, map_file, path_file


def hillside(seed: int = 7) -> ElevationMap:
    """Plausible ground: hills, a side slope, a ditch, an unknown hollow, and a band of sand."""
    random = np.random.default_rng(seed)
    width, height = (round(extent / RESOLUTION) + 1 for extent in _SIZE)
    x, y = np.meshgrid(np.arange(width) * RESOLUTION, np.arange(height) * RESOLUTION)
    ground = 1.6 * np.exp(-(((x - 30.0) / 9.0) ** 2) - ((y - 30.0) / 7.0) ** 2)
    ground += 2.2 * np.exp(-(((x - 46.0) / 8.0) ** 2) - ((y - 12.0) / 8.0) ** 2)
    ground += 0.06 * np.maximum(y - 34.0, 0.0) ** 1.5  # side slope in the north
    ditch = x - 36.0 - 2.0 * np.sin(y / 9.0)
    ground -= 0.55 * np.exp(-((ditch / 0.9) ** 2)) * (y < 22.0)
    ground += _roughness(random, ground.shape)
    unknown = ((x - 50.0) / 4.5) ** 2 + ((y - 30.0) / 3.0) ** 2 < 1.0
    ground[unknown] = np.nan
    ground[random.random(ground.shape) < 2e-5] = np.nan
    sand = (np.abs(x - 20.0 - 0.15 * y) < 3.0).astype(np.int64)
    return ElevationMap(
        elevation=ground,
        resolution=RESOLUTION,
        origin=(0.0, 0.0),
        terrain_class=sand,
        class_names=("", "sand"),
    )


def _roughness(random: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Noise whose height grows with its wavelength, a few centimetres in all [m]."""
    rows, columns = (np.fft.fftfreq(n, RESOLUTION) for n in shape)
    wave = np.hypot(rows[:, None], columns[None, :])
    colour = 1.0 / np.maximum(wave, 0.05) ** 1.8
    noise = np.fft.ifft2(np.fft.fft2(random.normal(size=shape)) * colour).real
    result: Floats = 0.05 * noise / noise.std()
    return result


def fan(count: int = 12, length: float = 44.0) -> list[CandidatePath]:
    """Candidates from one place: headings fan out and turn back towards the east."""
    along = np.arange(0.0, length, 0.5)
    paths = []
    for number, first in enumerate(np.linspace(-0.75, 0.75, count)):
        heading = first * np.cos(np.pi * along / length)
        steps = 0.5 * np.stack((np.cos(heading), np.sin(heading)), axis=1)
        points = np.asarray(_START) + np.concatenate((np.zeros((1, 2)), np.cumsum(steps, axis=0)))
        paths.append(CandidatePath(f"fan {number + 1:02d}", points))
    return paths
