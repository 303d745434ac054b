"""Compare the stops of drive logs with the distances that plans by a model allow."""

from __future__ import annotations

import msgspec
import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.calibration.coverage import MIN_STOPS, Coverage, covered
from slopewise.services.io.files import fault
from slopewise.services.io.log_checks import unseen_channels
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import Summary, input_errors

_PARTS = 4
"""Ranges of speed and of grade; with 20 stops each has 5."""


class PartCoverage(Summary, frozen=True):
    """Measured stops, and those that ended beyond the allowed distance.

    Stops from a speed that plans do not allow at all are beyond; `not_allowed` counts them.
    `interval` is 95 % of the share beyond, exact; `mean_excess_m` the mean of allowed minus actual
    distance of the others [m], null without any.
    """

    stops: int
    beyond: int
    share_beyond: float
    mean_excess_m: float | None
    not_allowed: int
    interval: list[float]


class RangeCoverage(PartCoverage, frozen=True):
    """Stops within a range of onset speed [m/s] or grade [rad]."""

    range: list[float]


class SessionCoverage(PartCoverage, frozen=True):
    """Stops of a session."""

    session: str


class CoverageSummary(PartCoverage, frozen=True, kw_only=True):
    """Output of `coverage --json`; `covers`: no more are beyond than chance explains.

    `decided`: there are the stops `needed` for an answer.
    """

    model: str
    stop_count: int = msgspec.field(name="found")
    quantile: float
    covers: bool
    decided: bool
    needed: int
    notes: list[str]
    by_speed: list[RangeCoverage]
    by_grade: list[RangeCoverage]
    by_session: list[SessionCoverage]


def coverage(logs: LogInput, model_file: str, *, quantile: float) -> CoverageSummary:
    """Compare the stops of logs with the distances that plans at a quantile allow."""
    if not 0.5 <= quantile <= 0.9999:
        raise fault("--quantile", "", f"expected a share in [0.5, 0.9999], got {quantile:g}")
    model = read_model(find_model(model_file))
    with progress_bar("comparing stops with the model", 2) as advance:
        log = logs.read_for(model)
        ground = logs.grade(log, model.vehicle)
        advance(1)
        with input_errors(logs.names):
            stops = covered(log.columns, log.runs, model, ground=ground, quantile=quantile)
        advance(1)
    return _summary(model.name, stops, list(unseen_channels(model.effect, log.columns)))


def _summary(model: str, stops: Coverage, notes: list[str]) -> CoverageSummary:
    speed = np.array([r.samples.window.held_speed for r in stops.records])
    grade = np.array([r.grade for r in stops.records])
    return CoverageSummary(
        *_part(stops, np.ones(len(stops.records), np.bool_)),
        model=model,
        stop_count=len(stops.windows),
        quantile=stops.quantile,
        covers=stops.covers(),
        decided=stops.decides(),
        needed=MIN_STOPS,
        notes=notes,
        by_speed=_by_range(stops, speed),
        by_grade=_by_range(stops, grade),
        by_session=[
            SessionCoverage(*_part(stops, stops.session == name), session=str(name))
            for name in dict.fromkeys(stops.session.tolist())
        ],
    )


def _part(
    stops: Coverage, members: Bools
) -> tuple[int, int, float, float | None, int, list[float]]:
    """Fields of a :class:`PartCoverage`."""
    part = stops.of(members)
    excess = part.excess
    ends = excess[np.isfinite(excess)]
    beyond = int(np.sum(excess < 0.0))
    share = beyond / len(excess) if len(excess) else 0.0
    mean = float(np.mean(ends)) if len(ends) else None
    return len(excess), beyond, share, mean, len(excess) - len(ends), list(part.interval())


def _by_range(stops: Coverage, values: Floats) -> list[RangeCoverage]:
    """Parts with equal numbers of stops."""
    parts = []
    for index in np.array_split(np.argsort(values, kind="stable"), min(_PARTS, len(values))):
        members = np.zeros(len(values), np.bool_)
        members[index] = True
        ends = [float(values[index].min()), float(values[index].max())]
        parts.append(RangeCoverage(*_part(stops, members), range=ends))
    return parts
