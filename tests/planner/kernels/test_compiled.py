"""Compiled functions mean what they say in Python."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.arrays import read_only
from slopewise.planner.kernels.compiled import inlined, kernel


@inlined
def ratio(a: float, b: float) -> float:
    return a / b


@kernel
def ratios(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    for i in range(len(a)):
        out[i] = ratio(a[i], b[i])


def test_division_by_zero_and_nan_follow_numpy() -> None:
    a, b = np.array([1.0, -1.0, 0.0, np.nan, 3.0]), np.array([0.0, 0.0, 0.0, 1.0, 2.0])
    out = np.empty(5)
    ratios(a, b, out)
    np.testing.assert_array_equal(out, [np.inf, -np.inf, np.nan, np.nan, 1.5])
    assert ratio(3.0, 2.0) == 1.5


def test_read_only_arrays_refuse_to_change() -> None:
    array = read_only(np.zeros(3))
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1.0
