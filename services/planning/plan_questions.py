"""Which questions can be answered, and which of their candidates are usable.

A question that asks for too much as a whole is an error; one candidate that cannot be used is
refused with a reason, the others go on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import InputError, ParameterError
from slopewise.planner.horizon.answer import HorizonSettings
from slopewise.planner.horizon.path_projection import locate
from slopewise.planner.horizon.refusals import out_of_reach
from slopewise.planner.path import EvenPath, batch, resample
from slopewise.services.planning.pace import Pace, unhurried
from slopewise.services.settings.service_settings import SizeLimits
from slopewise.services.wire.messages import Path, PlanRequest, RankedCandidate

_FEWEST_POINTS = 3
_FARTHEST = 1e9
"""Coordinates beyond that are none [m]."""

_FASTEST = 1e3
"""Speeds beyond that are none [m/s]."""


@dataclass(frozen=True, slots=True)
class Usable:
    """A candidate, and the station up to which it is known free [m]."""

    path: CandidatePath | EvenPath
    clear: float


def check(request: PlanRequest, sizes: SizeLimits, source: str) -> None:
    """Whether a question can be answered as a whole.

    Raises:
        InputError: names ``source``, the key it came on, and the field.
    """
    most = sizes.candidates
    if len(request.paths) > most:
        found = f"got {len(request.paths)}"
        raise InputError(source, "paths", f"expected at most {most} candidates, {found}")
    if request.client and request.pose is None:
        raise InputError(source, "pose", "expected x, y, heading of a named client, got none")
    if not abs(request.speed) <= _FASTEST:
        found = f"got {request.speed:g} m/s"
        raise InputError(source, "speed", f"expected at most {_FASTEST:g} m/s, {found}")
    if request.pose is not None and not all(abs(value) <= _FARTHEST for value in request.pose):
        raise InputError(source, "pose", f"expected coordinates of at most {_FARTHEST:g} m")
    if not request.client and request.speed < 0.0:
        found = f"got {request.speed:g} m/s"
        raise InputError(source, "speed", f"expected a speed >= 0 without a client, {found}")


def usable_of(
    request: PlanRequest, sizes: SizeLimits, spacing: float, source: str
) -> tuple[list[Usable], list[RankedCandidate]]:
    """Candidates in the order given; and those that are refused at a glance, with reasons.

    Args:
        request: as it came. sizes: that it may have. spacing: of stations [m]. source: for errors.

    Raises:
        InputError: all of them together are too long.
    """
    usable: dict[str, Usable] = {}
    refused: list[RankedCandidate] = []
    stations = 0.0
    for path, length in zip(request.paths, _lengths(request.paths, sizes), strict=True):
        try:
            if path.name in usable:
                raise ParameterError("name", "a name of its own, got one used before")
            if isinstance(length, ParameterError):
                raise length
            if path.clear is not None and not path.clear >= 0.0:
                raise ParameterError("clear", f"a distance >= 0 [m], got {path.clear}")
            stations += length / spacing + _FEWEST_POINTS
            candidate = CandidatePath(path.name, path.points, path.speed_limit)
            usable[path.name] = Usable(candidate, _clear_of(path, request))
        except ParameterError as error:
            refused.append(RankedCandidate(name=path.name, usable=False, reason=str(error)))
    if stations > sizes.stations:
        words = f"expected at most {sizes.stations} stations in all, got {stations:.0f}"
        raise InputError(source, "paths", words)
    return list(usable.values()), refused


def resampled(
    offered: Sequence[Usable], spacing: float, max_deviation: float, pace: Pace = unhurried
) -> tuple[list[Usable], list[RankedCandidate]]:
    """Candidates on even stations, and those on which none can be laid, with reasons.

    Args:
        offered: as they came. spacing: of stations [m]. pace: called for each candidate.
        max_deviation: how far stations may lie from the path that was given [m].
    """
    usable: list[Usable] = []
    refused: list[RankedCandidate] = []
    for one in offered:
        pace()
        try:
            usable.append(Usable(resample(one.path, spacing, max_deviation), one.clear))
        except ParameterError as error:
            refused.append(RankedCandidate(name=one.path.name, usable=False, reason=str(error)))
    return usable, refused


def at_the_vehicle(
    request: PlanRequest, usable: list[Usable], most: HorizonSettings
) -> tuple[list[Usable], list[RankedCandidate]]:
    """Candidates that the vehicle stands on, all if the request has no pose; and the refused.

    Args:
        request: as it came. usable: on even stations. most: how far a path may lie from it.
    """
    if request.pose is None or not usable:
        return usable, []
    x, y, heading = request.pose
    # On even stations already: the spacing is not used.
    paths = batch([one.path for one in usable], math.inf)
    reasons = out_of_reach(locate(paths.x, paths.y, paths.count, (x, y), heading), most)
    refused = [
        RankedCandidate(name=one.path.name, usable=False, reason=reason)
        for one, reason in zip(usable, reasons, strict=True)
        if reason
    ]
    return [one for one, reason in zip(usable, reasons, strict=True) if not reason], refused


def _lengths(paths: Sequence[Path], sizes: SizeLimits) -> list[float | ParameterError]:
    """Length of each polyline [m], or what can be seen to be wrong with it at a glance.

    All in one go: one by one, small arrays cost more than what is done with them.
    """
    found = [_misshapen(path.points, sizes.points) for path in paths]
    good = [i for i, fault in enumerate(found) if not isinstance(fault, ParameterError)]
    if not good:
        return found
    points = np.concatenate([paths[i].points for i in good])
    ends = np.cumsum([len(paths[i].points) for i in good])
    begins = np.concatenate(([0], ends[:-1]))
    with np.errstate(all="ignore"):
        reach = np.maximum.reduceat(np.abs(points).ravel(), 2 * begins)
        steps = points[1:] - points[:-1]
        between = ends[:-1] - 1
        squares = np.einsum("ij,ij->i", steps, steps)
        squares[between] = np.inf
        least = np.minimum.reduceat(squares, begins)
        squares[between] = 0.0
        length = np.add.reduceat(np.sqrt(squares), begins)
    for k, i in enumerate(good):
        # NaN is never below or above anything.
        if not reach[k] <= _FARTHEST:
            found[i] = ParameterError("points", "finite coordinates [m]")
        elif not least[k] > 0.0:
            at = int(np.argmin(squares[begins[k] : ends[k] - 1])) + 1
            words = "a place of its own: stations have to grow"
            found[i] = ParameterError(f"points[{at}]", words)
        elif length[k] > sizes.stations:
            words = f"a path of at most {sizes.stations} m, got {length[k]:g}"
            found[i] = ParameterError("points", words)
        else:
            found[i] = float(length[k])
    return found


def _misshapen(points: np.ndarray, most: int) -> float | ParameterError:
    """What is wrong with the shape of a polyline; 0 if nothing is."""
    if points.ndim != 2 or points.shape[1] != 2:
        return ParameterError("points", f"an array (n, 2) of x, y, got shape {points.shape}")
    if not _FEWEST_POINTS <= len(points) <= most:
        words = f"{_FEWEST_POINTS} … {most} points, got {len(points)}"
        return ParameterError("points", words)
    return 0.0


def _clear_of(path: Path, request: PlanRequest) -> float:
    clear = request.clear if path.clear is None else path.clear
    return np.inf if clear is None else clear
