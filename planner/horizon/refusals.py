"""Why candidates cannot be planned in a cycle: malformed, or out of the vehicle's reach."""

from __future__ import annotations

import math

import numpy as np

from planner.horizon.answer import HorizonSettings
from planner.horizon.path_projection import FEWEST, PathProjection
from planner.kernels.compiled import Bools, Floats, Ints, kernel
from planner.path import PathBatch

_ENDS = 0.01
"""A path that ends this close to the vehicle is driven [m]."""

_STEP = 1e-4
"""Stations closer than that are one place [m]."""


def malformed(paths: PathBatch, clear: Floats) -> list[str]:
    """Why candidates cannot be planned at all, empty for those that can."""
    finite, moving = np.empty((2, len(clear)), np.bool_)
    _soundness(paths.x, paths.y, paths.count, finite, moving)
    long, known = paths.count >= FEWEST, ~np.isnan(clear)
    reasons = [""] * len(clear)
    for j in np.flatnonzero(~(finite & moving & long & known)):
        if not long[j]:
            reasons[j] = f"the path has {paths.count[j]} stations, {FEWEST} at least"
        elif not finite[j]:
            reasons[j] = "the path has stations that are no numbers"
        elif not moving[j]:
            reasons[j] = "the path has two stations in one place"
        else:
            reasons[j] = "its clear distance is not a number"
    if len(set(paths.names)) < len(paths.names):
        names: set[str] = set()
        for i, name in enumerate(paths.names):
            if name in names:
                reasons[i] = "another candidate has this name"
            names.add(name)
    return reasons


def out_of_reach(place: PathProjection, most: HorizonSettings) -> list[str]:
    """Why candidates cannot be driven from where the vehicle is, empty for those that can."""
    near = (place.beside <= most.beside) & (-place.along <= most.ahead)
    drivable = near & (place.turned <= most.turned) & (place.left > _ENDS)
    reasons = [""] * len(drivable)
    beside, along, turned = (a.tolist() for a in (place.beside, place.along, place.turned))
    for j in np.flatnonzero(~drivable).tolist():
        reasons[j] = _refusal(beside[j], -along[j], turned[j], most)
    return reasons


def _refusal(beside: float, gap: float, turned: float, most: HorizonSettings) -> str:
    if beside > most.beside:
        return f"the path lies {beside:.2f} m beside the vehicle, {most.beside:g} m at most"
    if gap > most.ahead:
        return f"the path begins {gap:.2f} m ahead of the vehicle, {most.ahead:g} m at most"
    if turned > most.turned:
        off, allowed = math.degrees(turned), math.degrees(most.turned)
        return f"the path points {off:.0f}° off the heading, {allowed:.0f}° at most"
    return "the path ends here"


@kernel
def _soundness(x: Floats, y: Floats, count: Ints, finite: Bools, moving: Bools) -> None:
    for j in range(x.shape[1]):
        finite[j] = moving[j] = True
        for i in range(count[j]):
            finite[j] &= np.isfinite(x[i, j] + y[i, j])
            if i > 0:
                step_sq = (x[i, j] - x[i - 1, j]) ** 2 + (y[i, j] - y[i - 1, j]) ** 2
                moving[j] &= not step_sq < _STEP * _STEP
