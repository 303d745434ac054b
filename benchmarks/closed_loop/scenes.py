"""Ground and route of test drives, the same for every policy and on every machine."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from .course import Course, Route, draw_route
from .loop_terrain import PhysicsGround, crop, hills

TESTED = (0.4, 1.0)  # rows of each elevation model, as shares; models were learned on the others

_SERIES = 5  # of seeds
_ATTEMPTS = 200  # grounds that are tried for a route


def dem_folder() -> Path | None:
    """Folder of public elevation models, None without any."""
    default = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    folder = Path(os.environ.get("SLOPEWISE_DATA", default)) / "dem"
    return folder if any(folder.glob("*.tif")) else None


def scene(number: int, dem: Path | None) -> tuple[PhysicsGround, Route, Course]:
    """Ground, route and course of a drive; elevation models are the ground of two of three."""
    rng = np.random.default_rng((_SERIES, number))
    for _ in range(_ATTEMPTS):
        terrain = hills(rng) if dem is None or number % 3 == 0 else crop(dem, rng, TESTED)
        route = draw_route(terrain, rng)
        if route is not None:
            return terrain, route, Course(route, rng)
    raise RuntimeError(f"no route for drive {number} on {_ATTEMPTS} grounds")
