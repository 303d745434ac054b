"""Errors of a map's heights relative to each other, as one standard deviation for all cells [m].

The number that a map reports for most of its cells is used, not the mean, because a stop may be
anywhere. Without one, a number is assumed by the origin of the map:

- A robot's own map: 2 cm, the range noise of lidars and depth cameras averaged over a cell, and 5 %
  of a cell, because a cell of rough or sloping ground is reduced to one height.
- A surveyed map: 4 cm and 2 % of a cell, 6 cm at 1 m. That is what the USGS Lidar Base
  Specification allows smooth ground to scatter within a swath at quality levels 1 and 2 (3 cm at
  level 0, 8 cm between swaths).

An error that all cells share, such as a wrong datum, is not in it: no stop depends on it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from slopewise.models.arrays import Floats

QUANTILE = 0.95  # Share of the cells whose error is no larger: 19 of 20, as for other margins

_ON_ROBOT = (0.02, 0.05)
_SURVEYED = (0.04, 0.02)
"""Constant [m] and share of a cell's edge [1]; reasons and source in the module's docstring."""

_BOUNDS_SPACING = 4.0
"""Standard deviations between the bounds of a cell's height, as `elevation_mapping` has them."""


def assumed(resolution: float, *, surveyed: bool = False) -> float:
    """Error of a map that reports none [m]; surveyed is one that no robot made while driving."""
    constant, share = _SURVEYED if surveyed else _ON_ROBOT
    return constant + share * resolution


def one_for_all(stds: Floats) -> float | None:
    """The standard deviation of most cells [m]; None if no cell has one.

    ``stds``: any shape [m]; NaN, infinite or negative where not reported.
    """
    reported = stds[np.isfinite(stds) & (stds >= 0.0)]
    return float(np.quantile(reported, QUANTILE)) if len(reported) else None


def of_layers(
    names: Sequence[str], layer: Callable[[str], Floats], heights: Floats, resolution: float
) -> float | None:
    """Error that the layers of a grid map report [m]; None if they do not.

    By the names of `elevation_mapping`: `variance` [m²], with `horizontal_variance_x` and `_y` on
    the slope of the cell, or else `lower_bound` and `upper_bound` around the height [m].

    ``layer`` returns a layer by its name; all are (rows, columns), rows along x, columns along y.
    """
    known = np.isfinite(heights)
    if min(heights.shape) < 2:
        return None
    if "variance" in names:
        variance = layer("variance").astype(np.float64)
        slopes = zip(("x", "y"), np.gradient(heights, resolution), strict=True)
        for axis, slope in slopes:
            if (name := f"horizontal_variance_{axis}") in names:
                variance = variance + np.nan_to_num(slope) ** 2 * _reported(layer(name))
        reported = variance[known & np.isfinite(variance) & (variance >= 0.0)]
        return one_for_all(np.sqrt(reported))
    if "lower_bound" in names and "upper_bound" in names:
        low, high = (layer(name).astype(np.float64) for name in ("lower_bound", "upper_bound"))
        with np.errstate(invalid="ignore"):
            between = known & (low <= heights) & (heights <= high) & (low < high)
        return one_for_all((high - low)[between] / _BOUNDS_SPACING)
    return None


def _reported(variance: Floats) -> Floats:
    """A variance, 0 where it is not reported."""
    return np.where(np.isfinite(variance) & (variance >= 0.0), variance, 0.0)
