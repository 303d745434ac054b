"""Compare the stops of drive logs with the distances that plans by a model allow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.calibration.coverage import Coverage, covered
from slopewise.services.io.drive_log import read_logs
from slopewise.services.io.files import fault
from slopewise.services.io.log_checks import names_of, refuse_wrong_units, unseen_channels
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.io.track_grade import grade_by_map
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import Summary, input_errors

_PARTS = 4
"""Ranges of speed and of grade; with 20 stops each has 5."""


class PartCoverage(Summary, frozen=True):
    """Some stops against what plans allow.

    Attributes:
        stops: how many were measured.
        beyond: stops that ended beyond the allowed distance.
        share_beyond: their share.
        mean_excess_m: mean of allowed minus actual distance [m]; null without stops.
        not_allowed: stops from a speed that plans do not allow at all.
    """

    stops: int
    beyond: int
    share_beyond: float
    mean_excess_m: float | None
    not_allowed: int


class RangeCoverage(PartCoverage, frozen=True):
    """Stops within a range of onset speed [m/s] or grade [rad]."""

    range: list[float]


class SessionCoverage(PartCoverage, frozen=True):
    """Stops of a session."""

    session: str


class CoverageSummary(PartCoverage, frozen=True, kw_only=True):
    """Output of `coverage --json`; `covers`: no more are beyond than chance explains."""

    stop_count: int = msgspec.field(name="found")
    quantile: float
    covers: bool
    notes: list[str]
    by_speed: list[RangeCoverage]
    by_grade: list[RangeCoverage]
    by_session: list[SessionCoverage]


def coverage(
    logs: Sequence[Path],
    model_file: str,
    *,
    quantile: float,
    map_file: Path | None = None,
    nodata: NoData = None,
    topics: Path | None = None,
    columns: str = "",
    quiet: bool = True,
) -> CoverageSummary:
    """Read, measure, compare.

    Args:
        logs: tables or recordings.
        model_file: model file or shipped vehicle.
        quantile: one-sided probability that margins cover the model's uncertainty.
        map_file: elevation map that x, y of the logs lie on.
        nodata: height of the map that marks unknown ground [m].
        topics: topic mapping of recordings.
        columns: names and units of tables that differ.
        quiet: without a progress bar.

    Raises:
        InputError: names file and field, or says why there are no stops.
    """
    if not 0.5 <= quantile <= 0.9999:
        raise fault("--quantile", "", f"expected a share in [0.5, 0.9999], got {quantile:g}")
    model = read_model(find_model(model_file))
    with progress_bar("comparing stops with the model", 2, quiet=quiet) as advance:
        log = read_logs(logs, topics, columns)
        refuse_wrong_units(log)
        ground = grade_by_map(log, map_file, model.vehicle, nodata)
        advance(1)
        with input_errors(names_of(logs)):
            stops = covered(log.columns, log.runs, model, ground=ground, quantile=quantile)
        advance(1)
    return _summary(stops, list(unseen_channels(model.effect, log.columns)))


def _summary(stops: Coverage, notes: list[str]) -> CoverageSummary:
    speed = np.array([r.samples.window.held_speed for r in stops.records])
    grade = np.array([r.grade for r in stops.records])
    sessions = dict.fromkeys(stops.session.tolist())
    return CoverageSummary(
        *_part(stops, np.ones(len(stops.records), np.bool_)),
        stop_count=len(stops.windows),
        quantile=stops.quantile,
        covers=stops.covers(),
        notes=notes,
        by_speed=_by_range(stops, speed),
        by_grade=_by_range(stops, grade),
        by_session=[
            SessionCoverage(*_part(stops, stops.session == name), session=str(name))
            for name in sessions
        ],
    )


def _part(stops: Coverage, members: Bools) -> tuple[int, int, float, float | None, int]:
    """Fields of a :class:`PartCoverage`."""
    excess = stops.excess[members]
    ends = excess[np.isfinite(excess)]
    beyond = int(np.sum(excess < 0.0))
    share = beyond / len(excess) if len(excess) else 0.0
    mean = float(np.mean(ends)) if len(ends) else None
    return len(excess), beyond, share, mean, len(excess) - len(ends)


def _by_range(stops: Coverage, values: Floats) -> list[RangeCoverage]:
    """Parts with equal numbers of stops."""
    parts = []
    for index in np.array_split(np.argsort(values, kind="stable"), min(_PARTS, len(values))):
        members = np.zeros(len(values), np.bool_)
        members[index] = True
        ends = [float(values[index].min()), float(values[index].max())]
        parts.append(RangeCoverage(*_part(stops, members), range=ends))
    return parts
