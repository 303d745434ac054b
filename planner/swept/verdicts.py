"""What is left of the ground around a block against the limits of body and wheels."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bytes, Singles
from slopewise.planner.kernels.compiled import row_pass
from slopewise.planner.swept.lanes import PLUS_ZERO
from slopewise.planner.swept.screen_reach import ScreenBounds
from slopewise.planner.swept.surfaces import Surface

UNSEEN, BODY = 1, 2
"""Bits: something in reach is unknown; the body may strike."""


@row_pass
def judge_body(s: Surface, b: ScreenBounds, bits: Bytes) -> None:
    """What the surface costs at most, and the range of what is left, against the clearance."""
    half, one, two = np.float32(0.5), np.float32(1.0), np.float32(2.0)
    reach = np.sqrt(b.body_sq)
    for j in range(bits.shape[0]):
        bowl = half * (s.bend_x[j] + s.bend_y[j])
        across = half * (s.bend_x[j] - s.bend_y[j])
        saddle = np.sqrt(across * across + s.warp[j] * s.warp[j])
        slope = np.sqrt(s.east[j] * s.east[j] + s.north[j] * s.north[j])
        slope += reach * (abs(bowl) + saddle)
        # Heights of a block count at its middle.
        spread = s.highest[j] - s.lowest[j] + two * slope * b.corner
        # On a slope a wheel touches the ground a little uphill.
        lift = b.radius * (np.sqrt(one + slope * slope) - one)
        body = half * (bowl * (b.body_sq - b.wheel_sq) + saddle * (b.body_sq + b.saddle_sq))
        middle = half * (saddle * b.saddle_sq - bowl * b.wheel_sq)
        struck = max(body, middle) + b.between * (abs(bowl) + saddle) + b.spread * (spread + lift)
        # Where nothing could be taken off, nothing is known to be clear.
        clear = (spread >= np.float32(0.0)) & (struck <= b.clearance)
        bits[j] = 0 if clear else BODY


@row_pass
def judge_relief(s: Surface, b: ScreenBounds, relief: Singles, lift: Singles) -> None:
    """How far a wheel around a block may climb, and how far it may stand above the ground under its
    middle, beyond the slope there; inf where unknown.
    """
    half, one = np.float32(0.5), np.float32(1.0)
    for j in range(relief.shape[0]):
        bowl = half * (s.bend_x[j] + s.bend_y[j])
        across = half * (s.bend_x[j] - s.bend_y[j])
        bend = abs(bowl) + np.sqrt(across * across + s.warp[j] * s.warp[j])
        slope = np.sqrt(s.east[j] * s.east[j] + s.north[j] * s.north[j]) + b.near * bend
        # On a slope a wheel touches the ground a little uphill.
        uphill = b.radius * (np.sqrt(one + slope * slope) - one)
        # The surface bends within a block, here and there, and on the way to the climb.
        bends = half * bend * b.edge * b.edge
        rise = s.near[j] - s.base[j] + uphill + bends + bend * b.chord * b.apart
        relief[j] = rise if s.near[j] >= s.base[j] else np.float32(np.inf)
        # Its middle stands between cells, not on their facets; heights count at a block's middle.
        stands = s.under[j] - s.floor[j] + slope * b.corner + bends
        lift[j] = stands if s.under[j] >= s.floor[j] else np.float32(np.inf)


@row_pass
def nearest(hidden: Bytes, distance: np.float32, seen: Singles) -> None:
    """Unknown ground at a distance limits what is seen."""
    for j in range(seen.shape[0]):
        here = seen[j]
        there = distance if hidden[j] > 0 else here
        seen[j] = (there if there < here else here) + PLUS_ZERO


@row_pass
def unseen(seen: Singles, reach: np.float32, bits: Bytes) -> None:
    """Something within reach is unknown."""
    for j in range(bits.shape[0]):
        bits[j] |= UNSEEN if seen[j] < reach else 0
