"""Whether the metres of a raster's projection are metres on the ground.

Mercator, Plate Carrée and equal-area projections of the world stretch ground by a factor that grows
with latitude; slopes and distances from such a grid are wrong by it. National grids and UTM keep to
a few in a thousand.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.services.io.files import fault

METRES = ("metre", "meter", "metres", "meters", "m", "")
_SMALLEST_CELL = 2e-3  # [m] without a coordinate system, smaller cells are degrees
_MAX_STRETCH = 0.02
"""Highest relative error of a length [1]: UTM reaches 1.3 % at 16° from its meridian, and 2 % of a
slope is within what a surveyed map errs by."""
_STEP = 10.0  # [m] of the differences that show the stretch: rounding is below 1e-8 of it


def check(dataset: Any, path: Path) -> None:
    """Raise InputError unless the grid of a dataset of rasterio is in metres on the ground."""
    if not dataset.crs:
        left, low, right, high = dataset.bounds
        in_degrees = max(abs(left), abs(right)) <= 180.0 and max(abs(low), abs(high)) <= 90.0
        if dataset.transform.a < _SMALLEST_CELL and in_degrees:
            cell = f"cells of {dataset.transform.a:g} and no crs; that looks like degrees"
            raise fault(path, "crs", f"expected a projected one in metres, got {cell}")
        return
    try:
        projection = dataset.crs.to_dict(projjson=True)
    except Exception as error:  # noqa: BLE001  what GDAL raises here is documented nowhere
        got = type(error).__name__
        raise fault(path, "crs", f"expected a projected one in metres, got {got}") from None
    for part in _simple_systems(projection):
        name, kind = part.get("name", "unknown"), part.get("type", "unknown")
        got = "degrees" if kind.startswith("Geographic") else kind
        if kind not in ("ProjectedCRS", "EngineeringCRS", "LocalCRS", "VerticalCRS"):
            got = f"{name} ({got})"
            raise fault(path, "crs", f"expected a projected one in metres, got {got}")
        for axis in part.get("coordinate_system", {}).get("axis", ()):
            unit = axis.get("unit", "metre")
            unit = unit.get("name", "unknown") if isinstance(unit, dict) else unit
            if unit not in METRES:
                raise fault(path, "crs", f"expected metres, got {unit} in {name}")
        if kind == "ProjectedCRS":
            _check_scale(dataset, part, name, path)


def _check_scale(dataset: Any, projection: dict[str, Any], name: str, path: Path) -> None:
    worst = _worst_stretch(dataset, _ellipsoid(projection["base_crs"]))
    # Pseudo-Mercator is true at the equator alone, where no map of it is meant to be measured.
    pseudo = "Pseudo" in projection["conversion"]["method"]["name"]
    if pseudo or not abs(worst - 1.0) <= _MAX_STRETCH:
        got = f"{name}, whose metres are not metres on the ground: there one is {1.0 / worst:.3g} m"
        if math.isnan(worst):
            got = f"{name}, which has no such place"
        raise fault(path, "crs", f"expected a projected one in metres, got {got}")


def _worst_stretch(dataset: Any, ellipsoid: tuple[float, float]) -> float:
    """Length in the grid over that on the ground, in the direction where it is farthest from 1 [1].

    At the corners and in the middle, by differences; NaN where the projection has no such place.
    """
    from rasterio.crs import CRS
    from rasterio.warp import transform

    radius, flattening = ellipsoid
    left, low, right, high = dataset.bounds
    x = np.array([left, left, right, right, 0.5 * (left + right)])
    y = np.array([low, high, low, high, 0.5 * (low + high)])
    shift = 0.5 * _STEP * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    at = (np.stack([x, y], axis=1)[:, None, :] + shift).reshape(-1, 2)
    geographic = CRS.from_proj4(f"+proj=longlat +a={radius!r} +f={flattening!r} +no_defs")
    try:
        degrees = np.array(transform(dataset.crs, geographic, at[:, 0], at[:, 1])[:2])
    except Exception:  # noqa: BLE001  what GDAL raises here is documented nowhere
        return math.nan
    longitude, latitude = np.radians(degrees)
    # Positions in space, from the centre of the ellipsoid: they are smooth at the poles as well.
    squared = flattening * (2.0 - flattening)
    normal = radius / np.sqrt(1.0 - squared * np.sin(latitude) ** 2)
    up = (
        np.cos(latitude) * np.cos(longitude),
        np.cos(latitude) * np.sin(longitude),
        np.sin(latitude),
    )
    position = (normal * up * np.array([[1.0], [1.0], [1.0 - squared]])).reshape(3, 5, 4)
    ground = (position[:, :, 0::2] - position[:, :, 1::2]).transpose(1, 0, 2) / _STEP
    if not np.isfinite(ground).all():
        return math.nan
    with np.errstate(divide="ignore"):
        stretch = 1.0 / np.linalg.svd(ground, compute_uv=False).ravel()
    return float(stretch[np.argmax(np.abs(stretch - 1.0))])


def _ellipsoid(geographic: dict[str, Any]) -> tuple[float, float]:
    """Semi-major axis [m] and flattening [1]."""
    datum = geographic.get("datum") or geographic["datum_ensemble"]
    ellipsoid = datum["ellipsoid"]
    if "radius" in ellipsoid:
        return _metres(ellipsoid["radius"]), 0.0
    radius = _metres(ellipsoid["semi_major_axis"])
    if "inverse_flattening" in ellipsoid:
        return radius, 1.0 / ellipsoid["inverse_flattening"]
    return radius, 1.0 - _metres(ellipsoid["semi_minor_axis"]) / radius


def _metres(length: Any) -> float:
    if isinstance(length, dict):  # an axis in feet, of the last century
        unit = length["unit"]
        factor = unit["conversion_factor"] if isinstance(unit, dict) else 1.0
        return float(length["value"] * factor)
    return float(length)


def _simple_systems(projection: dict[str, Any]) -> list[dict[str, Any]]:
    """Horizontal and vertical system of a compound or bound one."""
    if projection.get("type") == "CompoundCRS":
        return [s for part in projection["components"] for s in _simple_systems(part)]
    if projection.get("type") == "BoundCRS":
        return _simple_systems(projection["source_crs"])
    return [projection]
