"""Ground as maps from functions, and drawn paths over it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap

Height = Callable[[np.ndarray, np.ndarray], Any]


def hills(x: Any, y: Any) -> Any:
    """Half a metre high, a few vehicle lengths long."""
    return 0.5 * np.sin(x / 3.0) + 0.3 * np.cos(y / 2.0)


def ground_map(
    height: Height,
    *,
    x: tuple[float, float] = (-3.0, 45.0),
    y: tuple[float, float] = (-6.0, 6.0),
    resolution: float = 0.25,
    unknown: Height | None = None,
    classes: Height | None = None,
    class_names: tuple[str, ...] = ("",),
) -> ElevationMap:
    """A map from functions of x and y [m]."""
    columns = round((x[1] - x[0]) / resolution) + 1
    rows = round((y[1] - y[0]) / resolution) + 1
    east, north = np.meshgrid(
        x[0] + resolution * np.arange(columns), y[0] + resolution * np.arange(rows)
    )
    elevation = np.broadcast_to(np.asarray(height(east, north), float), east.shape).copy()
    if unknown is not None:
        elevation[np.asarray(unknown(east, north), bool)] = np.nan
    return ElevationMap(
        elevation=elevation,
        resolution=resolution,
        origin=(x[0], y[0]),
        terrain_class=None if classes is None else np.asarray(classes(east, north), np.int64),
        class_names=class_names,
    )


def plane(rise: float = 0.0, cross: float = 0.0, **options: Any) -> ElevationMap:
    """z = rise x + cross y."""
    return ground_map(lambda x, y: rise * x + cross * y, **options)


def iced(**options: Any) -> ElevationMap:
    """Ice from x = 8 m to 12 m."""
    return plane(
        resolution=0.1,
        classes=lambda x, y: (x >= 8.0) & (x <= 12.0),
        class_names=("", "ice"),
        **options,
    )


def straight(length: float, heading: float = 0.0, **options: Any) -> CandidatePath:
    """From the origin."""
    along = np.array([0.0, length])
    return CandidatePath(
        options.pop("name", "straight"),
        np.stack([along * np.cos(heading), along * np.sin(heading)], axis=1),
        **options,
    )


def arc(length: float, curvature: float, heading: float = 0.0, **options: Any) -> CandidatePath:
    """A circle from the origin, left turns positive."""
    along = np.linspace(0.0, length, max(int(length / 0.1), 20))
    yaw = heading + curvature * along
    x = (np.sin(yaw) - np.sin(heading)) / curvature
    y = (np.cos(heading) - np.cos(yaw)) / curvature
    return CandidatePath(options.pop("name", "arc"), np.stack([x, y], axis=1), **options)
