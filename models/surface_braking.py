"""Differences from the base braking model: on one surface, or uphill."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import STEEPEST, Matrix, Quantities, non_negative, positive, quantity
from slopewise.models.stop_distance import StopDistance

MAX_CORNER_COUNT = 24
"""Lines of the trained hull [1]: bounds the cost per station."""

_STRAIGHT = 1e-6
"""Change of the slope of neighbouring lines that rounding may make [m/s per rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UphillBraking(Quantities):
    """Slope coefficients that replace ``m_m`` and ``b_m`` uphill. Source: Braking, Sec. 2."""

    m_m: float = quantity("s/m", "Change of the uphill slope coefficient with speed.", (-3.0, 3.0))
    b_m: float = quantity("1", "Uphill slope coefficient at rest.", (-5.0, 5.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceBraking(Quantities):
    """Differences on one named surface; every missing key is that of ``[braking]``.

    Attributes:
        covariance, speed_range, grade_range, roll_range, uphill, distance: See [braking].
        speed_by_grade: likewise; that of ``[braking]`` is dropped if the surface has ranges.
        class_id: number by which a map calls the surface; by default its place among the tables,
            counted from 1.
        state_of: the surface of which this is an unforeseeable state of the brakes instead of
            another ground, "" for the base; plans use the worse of the two.
    """

    m_m: float | None = quantity("s/m", "See [braking].", default=None)
    b_m: float | None = quantity("1", "See [braking].", default=None)
    m_b: float | None = quantity("s/m", "See [braking].", default=None)
    b_b: float | None = quantity("1", "See [braking].", default=None)
    dead_time: float | None = non_negative("s", "See [braking].", default=None)
    distance_offset: float | None = non_negative("m", "See [braking].", default=None)
    time_offset: float | None = non_negative("s", "See [braking].", default=None)
    force_std: float | None = non_negative("1", "See [braking].", default=None)
    force_scatter: float | None = non_negative("1", "See [braking].", default=None)
    dead_time_std: float | None = non_negative("s", "See [braking].", default=None)
    covariance: Matrix | None = None
    speed_range: tuple[float, float] | None = None
    grade_range: tuple[float, float] | None = None
    roll_range: tuple[float, float] | None = None
    speed_by_grade: Matrix | None = None
    sliding_friction: float | None = positive("1", "See [braking].", default=None)
    uphill: UphillBraking | None = None
    distance: StopDistance | None = None
    class_id: int | None = None
    state_of: str | None = None

    @property
    def given(self) -> dict[str, Any]:
        """Differing values, by the keys of ``[braking]``."""
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        del values["class_id"], values["state_of"]
        given = {name: value for name, value in values.items() if value is not None}
        if "speed_range" in given or "grade_range" in given:
            given.setdefault("speed_by_grade", None)
        return given


def validate_hull(name: str, corners: Matrix | None) -> None:
    """Check corners (grade [rad], speed [m/s]) of a hull of what was driven; None passes.

    Between the corners the covariance of the coefficients speaks; beyond them they extrapolate.
    Speeds are concave over the grade, so that the hull is the least of a few straight lines.

    Raises:
        ParameterError: names the field and what was expected.
    """
    if corners is None:
        return
    if not 2 <= len(corners) <= MAX_CORNER_COUNT or any(len(row) != 2 for row in corners):
        expected = f"2 … {MAX_CORNER_COUNT} pairs of grade and speed, got {len(corners)} rows"
        raise ParameterError(name, expected)
    table = np.array(corners)
    if not np.isfinite(table).all() or np.any(table[:, 1] < 0.0):
        raise ParameterError(name, "finite grades and speeds >= 0")
    if np.any(np.abs(table[:, 0]) > STEEPEST):
        raise ParameterError(name, f"grades up to {STEEPEST:.2f} rad: these are degrees?")
    if np.any(np.diff(table[:, 0]) <= 0.0):
        raise ParameterError(name, "grades that increase from pair to pair")
    slopes = np.diff(table[:, 1]) / np.diff(table[:, 0])
    if np.any(np.diff(slopes) > _STRAIGHT):
        raise ParameterError(name, "speeds that are concave over the grade, as a hull is")
