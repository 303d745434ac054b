"""Which candidates can be planned in a cycle; the others are malformed, or out of reach."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.quantity import degrees_hint
from slopewise.planner.followed_line import MIN_STATIONS
from slopewise.planner.horizon.answer import HorizonSettings, PlanarState, Ranked
from slopewise.planner.horizon.path_projection import PathProjection, locate
from slopewise.planner.path import PathBatch
from slopewise.planner.path_deviation import PathDeviation, path_deviation

_ENDS = 0.01
"""A path that ends this close to the vehicle is driven [m]."""

_ONE_PLACE = 1e-4
"""Stations closer than that are one place [m]."""


@dataclass(frozen=True, slots=True)
class Drivable:
    """Candidates that can be driven from where the vehicle is.

    Attributes:
        paths: M candidates, as they came. projection: the vehicle on them.
        clear: (M,) station up to which the ground is known to be free [m].
    """

    paths: PathBatch
    projection: PathProjection
    clear: Floats

    def deviation(
        self, j: int, x: Floats, y: Floats, station: Floats, limit: float
    ) -> PathDeviation:
        """How far a line along candidate j lies from what was given of it from the vehicle on.

        Args:
            j: index of the candidate. x, y, station: (N,) of the line [m].
            limit: that it has to keep [m].
        """
        here, passed = self.projection, float(self.projection.along[j])
        if passed > 0.0:
            passed -= math.hypot(x[0] - here.x[j], y[0] - here.y[j])
        length = float(here.along[j] + here.remaining[j])
        given = self.paths.given_points(j)
        return path_deviation(given, x, y, station, limit, (passed, length))


def drivable_of(
    paths: PathBatch,
    clear: Floats,
    state: PlanarState,
    settings: HorizonSettings,
    max_deviation: float,
) -> tuple[Drivable | None, tuple[Ranked, ...]]:
    """Candidates that can be driven, None without any; and the others, with reasons.

    Args:
        paths: M candidates; clear: (M,) station up to which each is known to be free [m].
        state: the vehicle's.
        settings: how far a path may lie from it.
        max_deviation: how far stations may be from the path that was given [m].
    """
    reasons = malformed(paths, clear, max_deviation)
    sound = np.flatnonzero([not reason for reason in reasons])
    drivable = None
    if len(sound) > 0:
        part = paths.only(sound) if len(sound) < len(reasons) else paths
        projection = locate(part.x, part.y, part.count, (state.x, state.y), state.heading)
        refusals = out_of_reach(projection, state.heading, settings)
        for j, reason in zip(sound, refusals, strict=True):
            reasons[j] = reason
        usable = np.flatnonzero([not reason for reason in reasons])
        if len(usable) == len(reasons):
            drivable = Drivable(paths, projection, clear)
        elif len(usable) > 0:
            projection = projection.only(np.searchsorted(sound, usable))
            drivable = Drivable(paths.only(usable), projection, clear[usable])
    refused = zip(paths.names, reasons, strict=True)
    return drivable, tuple(
        Ranked(name, np.inf, False, reason) for name, reason in refused if reason
    )


def malformed(paths: PathBatch, clear: Floats, max_deviation: float) -> list[str]:
    """Reasons why candidates cannot be planned at all, empty for those that can."""
    inside = np.arange(len(paths.x))[:, None] < paths.count
    finite: Bools = np.all(np.isfinite(paths.rows[:2]).all(axis=0) | ~inside, axis=0)
    with np.errstate(invalid="ignore"):
        steps = np.diff(paths.rows[:2], axis=1)
    stays = (steps * steps).sum(axis=0) < _ONE_PLACE**2
    moving: Bools = ~np.any(stays & inside[1:], axis=0)
    long, known = paths.count >= MIN_STATIONS, ~np.isnan(clear)
    reasons = [""] * len(clear)
    for j in np.flatnonzero(~(finite & moving & long & known)):
        if not long[j]:
            reasons[j] = f"the path has {paths.count[j]} stations, {MIN_STATIONS} at least"
        elif not finite[j]:
            reasons[j] = "the path has stations that are no numbers"
        elif not moving[j]:
            reasons[j] = "the path has two stations in one place"
        else:
            reasons[j] = "its clear distance is not a number"
    for i, given in enumerate(paths.given):
        if given is not None and given.deviation > max_deviation and not reasons[i]:
            reasons[i] = (
                f"its stations lie {given.deviation:.2f} m from the path that was given, "
                f"{max_deviation:.3g} m at most (limits.max_path_deviation)"
            )
    if len(set(paths.names)) < len(paths.names):
        names: set[str] = set()
        for i, name in enumerate(paths.names):
            if name in names:
                reasons[i] = "another candidate has this name"
            names.add(name)
    return reasons


def out_of_reach(projection: PathProjection, heading: float, limits: HorizonSettings) -> list[str]:
    """Reasons why candidates cannot be driven from the vehicle on, empty for those that can.

    Args:
        projection: the vehicle on the candidates.
        heading: that of the vehicle [rad]; it may count any number of turns.
        limits: how far a path may lie from the vehicle.
    """
    near = (projection.lateral_offset <= limits.beside) & (-projection.along <= limits.ahead)
    drivable = near & (projection.turned <= limits.turned) & (projection.remaining > _ENDS)
    reasons = [""] * len(drivable)
    lateral, along, turned = (
        values.tolist()
        for values in (projection.lateral_offset, projection.along, projection.turned)
    )
    for j in np.flatnonzero(~drivable).tolist():
        reasons[j] = _refusal(lateral[j], -along[j], turned[j], heading, limits)
    return reasons


def _refusal(
    lateral: float, gap: float, turned: float, heading: float, limits: HorizonSettings
) -> str:
    if lateral > limits.beside:
        return f"the path lies {lateral:.2f} m beside the vehicle, {limits.beside:g} m at most"
    if gap > limits.ahead:
        return f"the path begins {gap:.2f} m ahead of the vehicle, {limits.ahead:g} m at most"
    if turned > limits.turned:
        error = f"{math.degrees(turned):.0f}° off the heading ({turned:.3f} rad)"
        return f"the path points {error}, {limits.turned:g} rad at most{degrees_hint(heading)}"
    return "the path ends here"
