"""Obstacles as continuous shapes: convex outlines with one height each, on a plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Bools, Floats

FAR = 60.0
"""Half length of an endless shape [m]."""


@dataclass(frozen=True, slots=True)
class Block:
    """A turned rectangle of ground that is higher or lower than the plane around it.

    The path runs along x of this frame, through y = 0.

    Attributes:
        x, y: place of its middle [m].
        yaw: direction of its long sides from the path [rad].
        half_length, half_width: along and across its own x [m].
        height: above the plane, below it if negative [m].
    """

    x: float
    y: float
    yaw: float
    half_length: float
    half_width: float
    height: float

    def grown(self, by: float) -> Block:
        """Return it wider on all sides, smaller if ``by`` is negative [m]."""
        return Block(
            self.x,
            self.y,
            self.yaw,
            max(self.half_length + by, 0.0),
            max(self.half_width + by, 0.0),
            self.height,
        )

    def contains(self, x: Floats, y: Floats) -> Bools:
        """Mask of the points inside."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        along = c * (x - self.x) + s * (y - self.y)
        across = c * (y - self.y) - s * (x - self.x)
        inside: Bools = (np.abs(along) <= self.half_length) & (np.abs(across) <= self.half_width)
        return inside

    @property
    def corners(self) -> Floats:
        """Corners in order around it, shape (4, 2) [m]."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        u = self.half_length * np.array([1.0, -1.0, -1.0, 1.0])
        v = self.half_width * np.array([1.0, 1.0, -1.0, -1.0])
        return np.column_stack([self.x + c * u - s * v, self.y + s * u + c * v])

    def span_between(self, x_min: float, x_max: float) -> tuple[float, float] | None:
        """Smallest and largest y where x is within a range, None outside [m]."""
        points = self.corners
        sides = [p[1] for p in points if x_min <= p[0] <= x_max]
        for first, second in zip(points, np.roll(points, -1, axis=0), strict=True):
            for x in (x_min, x_max):
                if (first[0] - x) * (second[0] - x) < 0.0:
                    share = (x - first[0]) / (second[0] - first[0])
                    sides.append(first[1] + share * (second[1] - first[1]))
        return (float(min(sides)), float(max(sides))) if sides else None


@dataclass(frozen=True, slots=True)
class Slope:
    """Plane under obstacles: rise along the path and to its left [1]."""

    along: float
    across: float


def height_of(block: Block, slope: Slope, x: Floats, y: Floats) -> Floats:
    """Height of the ground at points of the path's frame [m]."""
    raised: Floats = np.where(block.contains(x, y), block.height, 0.0)
    return slope.along * x + slope.across * y + raised
