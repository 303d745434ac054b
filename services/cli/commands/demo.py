"""`slopewise demo`: a generated hillside, a dozen candidates, plans and a page to look at."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.settings import PlannerSettings
from slopewise.services.cli.commands import plan as planning
from slopewise.services.cli.commands import plan_view
from slopewise.services.io.map_file import write_map_npz
from slopewise.services.io.path_file import write_paths_csv

RESOLUTION = 0.2
_SIZE = (60.0, 48.0)  # [m] east, north
_START = (6.0, 24.0)
_MODEL = "atv"


class Demo(NamedTuple):
    """What was planned, and the page that shows it."""

    result: planning.PlanResult
    page: Path


def run(folder: Path) -> Demo:
    """Generate, plan, write."""
    folder.mkdir(parents=True, exist_ok=True)
    map_file, path_file = folder / "map.npz", folder / "paths.csv"
    write_map_npz(hillside(), map_file)
    write_paths_csv(fan(), path_file)
    job = planning.PlanJob(map_file, path_file, _MODEL, 1.5, np.inf, PlannerSettings())
    result = planning.run(job)
    planning.write_csv(result, folder / "plan.csv")
    page = folder / "report.html"
    plan_view.write_page(result, job, page)
    return Demo(result, page)


def as_json(demo: Demo) -> dict[str, Any]:
    """For machines."""
    return {**plan_view.as_json(demo.result), "page": str(demo.page)}


def show(demo: Demo, console: Console) -> None:
    """For people."""
    plan_view.show(demo.result, console)
    console.print(
        f"\nOpen {demo.page} in a browser to see them",
        soft_wrap=True,
        markup=False,
        highlight=False,
    )


def hillside(seed: int = 7) -> ElevationMap:
    """Plausible ground: hills, a side slope, a ditch, an unseen hollow, and a band of sand."""
    random = np.random.default_rng(seed)
    width, height = (round(extent / RESOLUTION) + 1 for extent in _SIZE)
    x, y = np.meshgrid(np.arange(width) * RESOLUTION, np.arange(height) * RESOLUTION)
    ground = 1.6 * np.exp(-(((x - 30.0) / 9.0) ** 2) - ((y - 30.0) / 7.0) ** 2)
    ground += 2.2 * np.exp(-(((x - 46.0) / 8.0) ** 2) - ((y - 12.0) / 8.0) ** 2)
    ground += 0.06 * np.maximum(y - 34.0, 0.0) ** 1.5  # side slope in the north
    ditch = x - 36.0 - 2.0 * np.sin(y / 9.0)
    ground -= 0.55 * np.exp(-((ditch / 0.9) ** 2)) * (y < 22.0)
    ground += _roughness(random, ground.shape)
    unseen = ((x - 50.0) / 4.5) ** 2 + ((y - 30.0) / 3.0) ** 2 < 1.0
    ground[unseen] = np.nan
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
    """Candidates from one place: headings fan out and bend back towards the east."""
    along = np.arange(0.0, length, 0.5)
    paths = []
    for number, first in enumerate(np.linspace(-0.75, 0.75, count)):
        heading = first * np.cos(np.pi * along / length)
        steps = 0.5 * np.stack((np.cos(heading), np.sin(heading)), axis=1)
        points = np.asarray(_START) + np.concatenate((np.zeros((1, 2)), np.cumsum(steps, axis=0)))
        paths.append(CandidatePath(f"fan {number + 1:02d}", points))
    return paths
