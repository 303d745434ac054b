"""The band around the planned line in which body and wheels may be, with the errors of tracking."""

from __future__ import annotations

import math
from typing import NamedTuple

from slopewise.models.arrays import Floats
from slopewise.models.input_errors import InputErrors

_CELL_SHARE = 0.5
"""Bands of one map are rounded up to this share of a cell [1], so that its broad phase serves all
candidates of a cycle and of the next ones."""

COARSE = 0.05
"""Sizes that change with each pose are rounded up to that [m], for the same reason."""


class BandWidth(NamedTuple):
    """How far a vehicle may be off its line, for the broad phase.

    Attributes:
        widest: by how much the reference point may be off, at most [m].
        turned: sine of the heading error.
        body_offset: distance from the reference point ahead to mid-wheelbase [m].
    """

    widest: float
    turned: float
    body_offset: float


def tube_of(
    errors: InputErrors,
    curvature: Floats,
    body_offset: float,
    resolution: float,
    added_band: Floats | None = None,
) -> tuple[Floats, BandWidth] | None:
    """By how far the reference point may be off the line, (N, M) [m], and a width that covers it.

    None for a vehicle that follows its plan exactly.

    Args:
        errors: at the quantile of the plan.
        curvature: of M candidates of up to N stations, (N, M) [1/m].
        body_offset: distance from the reference point ahead to mid-wheelbase [m].
        resolution: edge of a cell [m].
        added_band: what is added to the band, (N, M) [m].
    """
    if added_band is None and not errors.has_band:
        return None
    across = errors.across(curvature)
    step = _CELL_SHARE * resolution
    if added_band is not None:
        across, step = across + added_band, max(step, COARSE)
    widest = step * math.ceil(float(across.max()) / step)
    return across, BandWidth(widest, math.sin(errors.heading), body_offset)
