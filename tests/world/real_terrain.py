"""Public elevation models and random candidates over them; tests skip where they are absent."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.services.io.map_file import read_map

CANDIDATES = 200


def read_text_grid(path: Path, offset: Path) -> ElevationMap:
    """Rows of heights on a 0.1 m grid, and the coordinates of its first cell.

    The rows are taken as they come, the first at minimum y. The files do not say whether that is
    south or north; slopes are the same either way, and so are plans on the mirrored map.
    """
    x, y = np.loadtxt(offset)
    return ElevationMap(elevation=np.loadtxt(path), resolution=0.1, origin=(float(x), float(y)))


@dataclass(frozen=True)
class Place:
    """One elevation model and the candidates that suit its size."""

    files: tuple[str, ...]
    read: Callable[..., ElevationMap]
    lengths: tuple[float, float]
    curvature: float
    vehicles: tuple[str, ...]


PLACES = {
    "TM1": Place(("TM1_564_146.tif",), read_map, (15.0, 40.0), 0.12, ("atv", "husky", "ugv")),
    "giswqs": Place(("giswqs_dem.tif",), read_map, (15.0, 40.0), 0.12, ("atv", "husky", "ugv")),
    "Colmenar": Place(
        ("ColmenarRocks_Nominal_10cmDEM.csv", "ColmenarRocks_Nominal_10cmOffset.csv"),
        read_text_grid,
        (5.0, 7.0),
        0.3,
        ("husky",),
    ),
}
CASES = [(place, vehicle) for place, p in PLACES.items() for vehicle in p.vehicles]
_READ: dict[str, ElevationMap] = {}


def ground_of(place: str, data: Path) -> ElevationMap:
    files = [data / "dem" / name for name in PLACES[place].files]
    for file in files:
        if not file.is_file():
            pytest.skip(f"no elevation model at {file}")
    if place not in _READ:
        _READ[place] = PLACES[place].read(*files)
    return _READ[place]


def candidates(place: str, ground: ElevationMap, seed: int) -> list[CandidatePath]:
    """Random clothoids towards the inside of the map."""
    rng = np.random.default_rng(seed)
    x_min, x_max, y_min, y_max = ground.extent
    centre = 0.5 * np.array([x_min + x_max, y_min + y_max])
    spread = 0.45 * np.array([x_max - x_min, y_max - y_min])
    paths = []
    for i in range(CANDIDATES):
        start = centre + rng.uniform(-spread, spread)
        inward = np.arctan2(*(centre - start)[::-1])
        length = rng.uniform(*PLACES[place].lengths)
        first, last = rng.uniform(-PLACES[place].curvature, PLACES[place].curvature, 2)
        s = np.linspace(0.0, length, int(length / 0.2))
        yaw = inward + rng.uniform(-0.8, 0.8) + first * s + (last - first) * s**2 / (2.0 * length)
        steps = np.diff(s)[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)[1:]
        points = start + np.concatenate([[(0.0, 0.0)], np.cumsum(steps, axis=0)])
        paths.append(CandidatePath(f"{place}-{i}", points))
    return paths


def data_folder() -> Path:
    """Where the public recordings are, if they are."""
    default = Path(__file__).parents[3] / "shared" / "data"
    return Path(os.environ.get("SLOPEWISE_DATA", default))
