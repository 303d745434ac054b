"""Where test drives go, drawn from a number: the same for every policy and on every machine."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from .course import Course
from .quad import QUAD
from .route import Route, draw_route
from .terrain import PhysicsGround, crop, hills

LEARNED, TESTED = (0.0, 0.4), (0.4, 1.0)
"""Rows of each elevation model, as shares: ground to learn on, and ground that only tests see."""

_SERIES = 5
_ATTEMPTS = 200


def dem_folder() -> Path | None:
    """Folder of public elevation models, None where there is none."""
    beside = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    folder = Path(os.environ.get("SLOPEWISE_DATA", beside)) / "dem"
    return folder if any(folder.glob("*.tif")) else None


def scene(number: int, dem: Path | None) -> tuple[PhysicsGround, Route, Course]:
    """Ground, route and what happens on it.

    Args:
        number: of the drive.
        dem: elevation models; two of three drives go over them, all over hills if None.

    Raises:
        RuntimeError: no ground with a route; it would take a folder of cliffs.
    """
    rng = np.random.default_rng((_SERIES, number))
    for _ in range(_ATTEMPTS):
        terrain = hills(rng) if dem is None or number % 3 == 0 else crop(dem, rng, TESTED)
        route = draw_route(terrain, rng, QUAD)
        if route is not None:
            return terrain, route, Course(route, rng)
    raise RuntimeError(f"no route for drive {number} on {_ATTEMPTS} grounds")
