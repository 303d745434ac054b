"""Validation of plan requests and of their candidates.

A request that is malformed or too large as a whole is an error; one candidate that is not usable is
rejected with a reason, and the remaining ones are planned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.quantity import MAX_SPEED
from slopewise.planner.followed_line import LineLimits
from slopewise.planner.horizon.answer import HorizonSettings
from slopewise.planner.horizon.path_projection import locate
from slopewise.planner.horizon.refusals import out_of_reach
from slopewise.planner.path import EvenPath, batch, resample
from slopewise.services.planning.deadline_check import DeadlineCheck, no_deadline
from slopewise.services.settings.service_settings import SizeLimits
from slopewise.services.wire.plan_messages import Path, PlanRequest, RankedCandidate

_MIN_POINTS = 3  # fewest points of a path [1]: curvature needs three

_MAX_COORDINATE = 1e9
"""Largest coordinate [m]: beyond it float64 resolves less than 0.1 µm, and UTM ends at 1e7."""


@dataclass(frozen=True, slots=True)
class PlanCandidate:
    """A candidate path and the station up to which it is known to be free [m]."""

    path: CandidatePath | EvenPath
    clear: float


@dataclass(frozen=True, slots=True)
class Validated:
    """Usable candidates in the order of the request; the rejected ones with their reasons."""

    candidates: list[PlanCandidate]
    rejected: list[RankedCandidate]


def rejection(name: str, reason: str) -> RankedCandidate:
    """A candidate that is not planned."""
    return RankedCandidate(name=name, usable=False, reason=reason)


def validate_request(request: PlanRequest, sizes: SizeLimits, key: str) -> None:
    """Check a request as a whole."""
    count, client, pose, speed = len(request.paths), request.client, request.pose, request.speed
    in_range = all(abs(n) <= _MAX_COORDINATE for n in pose or ())
    for is_met, field, expected in (
        (count <= sizes.candidates, "paths", f"at most {sizes.candidates} candidates, got {count}"),
        (pose or not client, "pose", "x, y, heading of a named client, got none"),
        (abs(speed) <= MAX_SPEED, "speed", f"at most {MAX_SPEED:g} m/s, got {speed:g} m/s"),
        (in_range, "pose", f"coordinates of at most {_MAX_COORDINATE:g} m"),
        (client or speed >= 0.0, "speed", f"a speed >= 0 without a client, got {speed:g} m/s"),
    ):
        if not is_met:
            raise InputError(key, field, f"expected {expected}")


def validate_candidates(
    request: PlanRequest, sizes: SizeLimits, spacing: float, key: str
) -> Validated:
    """Check all candidates, without resampling them; ``spacing`` of stations [m]."""
    usable: dict[str, PlanCandidate] = {}
    rejected: list[RankedCandidate] = []
    stations = 0.0
    for path, length in zip(request.paths, _lengths(request.paths, sizes), strict=True):
        try:
            if path.name in usable:
                raise ParameterError("name", "a unique name, got one used before")
            if isinstance(length, ParameterError):
                raise length
            if path.clear is not None and not path.clear >= 0.0:
                raise ParameterError("clear", f"a distance >= 0 [m], got {path.clear}")
            stations += length / spacing + _MIN_POINTS
            candidate = CandidatePath(path.name, path.points, path.speed_limit)
            usable[path.name] = PlanCandidate(candidate, _clear_of(path, request))
        except ParameterError as error:
            rejected.append(rejection(path.name, str(error)))
    if stations > sizes.stations:
        expected = f"expected at most {sizes.stations} stations in all, got {stations:.0f}"
        raise InputError(key, "paths", expected)
    return Validated(list(usable.values()), rejected)


def resample_all(
    candidates: Sequence[PlanCandidate],
    spacing: float,
    limits: LineLimits,
    check_deadline: DeadlineCheck = no_deadline,
) -> Validated:
    """Candidates at uniform ``spacing`` [m], on lines that keep ``limits``."""
    usable: list[PlanCandidate] = []
    rejected: list[RankedCandidate] = []
    for candidate in candidates:
        check_deadline()
        try:
            path = resample(candidate.path, spacing, limits)
            usable.append(PlanCandidate(path, candidate.clear))
        except ParameterError as error:
            rejected.append(rejection(candidate.path.name, str(error)))
    return Validated(usable, rejected)


def select_at_vehicle(
    request: PlanRequest, candidates: list[PlanCandidate], limits: HorizonSettings
) -> Validated:
    """Resampled candidates on which the vehicle stands; all if the request has no pose."""
    if request.pose is None or not candidates:
        return Validated(candidates, [])
    x, y, heading = request.pose
    # Already resampled: the spacing is not used.
    paths = batch([candidate.path for candidate in candidates], math.inf)
    projection = locate(paths.x, paths.y, paths.count, (x, y), heading)
    reasons = out_of_reach(projection, heading, limits)
    return Validated(
        [c for c, reason in zip(candidates, reasons, strict=True) if not reason],
        [rejection(c.path.name, r) for c, r in zip(candidates, reasons, strict=True) if r],
    )


def _lengths(paths: Sequence[Path], sizes: SizeLimits) -> list[float | ParameterError]:
    """Length of each polyline [m], or what is wrong with it.

    All together: separately, the calls of numpy would take longer than their work.
    """
    lengths = [_check_shape(path.points, sizes.points) for path in paths]
    checked = [i for i, fault in enumerate(lengths) if not isinstance(fault, ParameterError)]
    if not checked:
        return lengths
    points = np.concatenate([paths[i].points for i in checked])
    ends = np.cumsum([len(paths[i].points) for i in checked])
    starts = np.concatenate(([0], ends[:-1]))
    with np.errstate(all="ignore"):
        largest = np.maximum.reduceat(np.abs(points).ravel(), 2 * starts)
        steps = points[1:] - points[:-1]
        between = ends[:-1] - 1
        squares = np.einsum("ij,ij->i", steps, steps)
        squares[between] = np.inf
        shortest = np.minimum.reduceat(squares, starts)
        squares[between] = 0.0
        length = np.add.reduceat(np.sqrt(squares), starts)
    for k, i in enumerate(checked):
        # NaN is never below or above anything.
        if not largest[k] <= _MAX_COORDINATE:
            expected = f"finite coordinates of at most {_MAX_COORDINATE:g} m"
            lengths[i] = ParameterError("points", expected)
        elif not shortest[k] > 0.0:
            at = int(np.argmin(squares[starts[k] : ends[k] - 1])) + 1
            expected = "a point that differs from the one before: stations have to increase"
            lengths[i] = ParameterError(f"points[{at}]", expected)
        elif length[k] > sizes.stations:
            expected = f"a path of at most {sizes.stations} m, got {length[k]:g}"
            lengths[i] = ParameterError("points", expected)
        else:
            lengths[i] = float(length[k])
    return lengths


def _check_shape(points: np.ndarray, max_count: int) -> float | ParameterError:
    """0 for the points of a polyline, else what is wrong with their shape."""
    if points.ndim != 2 or points.shape[1] != 2:
        return ParameterError("points", f"an array (n, 2) of x, y, got shape {points.shape}")
    if not _MIN_POINTS <= len(points) <= max_count:
        expected = f"{_MIN_POINTS} … {max_count} points, got {len(points)}"
        return ParameterError("points", expected)
    return 0.0


def _clear_of(path: Path, request: PlanRequest) -> float:
    clear = request.clear if path.clear is None else path.clear
    return np.inf if clear is None else clear
