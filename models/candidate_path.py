"""Candidate path: a polyline offered for planning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats, read_only
from slopewise.models.errors import ParameterError
from slopewise.models.typed_arguments import check_fields


@dataclass(frozen=True, slots=True, eq=False)
class CandidatePath:
    """One polyline to be driven forward from its first point, in map coordinates.

    Attributes:
        name: how plans and reports call it.
        points: (n, 2) positions of the middle of the wheelbase [m], at least 2.
        speed_limit: (n,) highest speed at each point [m/s], None without limits.
        yaw: (n,) heading of the vehicle [rad]; only checked against the direction of travel.
    """

    name: str
    points: Floats
    speed_limit: Floats | None = None
    yaw: Floats | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        points = np.array(self.points, dtype=np.float64, order="C")
        if points.ndim != 2 or points.shape[1] != 2:
            raise ParameterError("points", f"an array (n, 2) of x, y, got shape {points.shape}")
        if len(points) < 2:
            raise ParameterError("points", f"at least 2 points, got {len(points)}")
        if not np.all(np.isfinite(points)):
            first = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
            raise ParameterError(f"points[{first}]", "finite coordinates [m]")
        object.__setattr__(self, "points", read_only(points))
        for name in ("speed_limit", "yaw"):
            values = getattr(self, name)
            if values is None:
                continue
            values = np.array(values, dtype=np.float64, order="C")
            if values.shape != (len(points),) or not np.all(np.isfinite(values)):
                raise ParameterError(name, f"{len(points)} finite numbers, one for each point")
            object.__setattr__(self, name, read_only(values))
        if self.speed_limit is not None and np.any(self.speed_limit < 0.0):
            raise ParameterError("speed_limit", "speeds >= 0 [m/s]")
