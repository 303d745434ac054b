"""`slopewise calibrate --sheet`: the brake sheet of the model that was learned."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from datetime import datetime
from importlib import metadata
from pathlib import Path

from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.services.cli.arguments.files import CalibrateOptions
from slopewise.services.cli.commands.calibrate import CalibrateResult
from slopewise.services.cli.commands.calibration_rows import ROWS, coverage
from slopewise.services.io.files import sha256_of
from slopewise.services.io.model_file import find_model, model_sha256
from slopewise.services.report.brake_numbers import BrakeNumbers
from slopewise.services.report.brake_sheet import check_name, write_sheet

_TRACED = 6
"""Logs that the sheet has a line for."""


def check_sheet(path: Path | None) -> None:
    """Raise InputError for a name that promises another kind of file than a brake sheet is."""
    if path is not None:
        check_name(path)


def with_sheet(result: CalibrateResult, job: CalibrateOptions, path: Path) -> CalibrateResult:
    """Write the brake sheet of the learned model, and keep its numbers."""
    base = result.calibration.surfaces[0]
    inside, longer = coverage(base)
    facts = {
        "stops learned from": ROWS["stops learned from"](base),
        "unseen, within": f"{inside:.1%}, on average {longer:.3f} m to spare",
    }
    numbers = BrakeNumbers(result.model, Uncertainty(quantile=job.coverage))
    write_sheet(path, numbers, facts, "\n".join(trace_of(result, job)))
    return replace(result, sheet=numbers)


def trace_of(result: CalibrateResult, job: CalibrateOptions) -> list[str]:
    """What the sheet was made from, a line each."""
    digests = [(path.name, sha256_of(path)) for path in job.logs]
    lines = [f"log {digest}  {name}" for name, digest in digests[:_TRACED]]
    if more := digests[_TRACED:]:
        told = "\n".join(f"{digest}  {name}" for name, digest in digests) + "\n"
        every = hashlib.sha256(told.encode()).hexdigest()
        lines.append(f"    {every}  of the lines '<sha256>  <name>' of all, {len(more)} more")
    before, out = find_model(job.model), job.out.name if job.out else "not written"
    lines.append(f"old {sha256_of(before)}  {before.name}, the model so far")
    lines.append(f"new {model_sha256(result.model)}  {out}, the model of this sheet")
    if job.map_file is not None:
        lines.append(f"map {sha256_of(job.map_file)}  {job.map_file.name}")
    moment = f"{datetime.now():%Y-%m-%d %H:%M}"
    return [f"sha256; slopewise {metadata.version('slopewise')}, written {moment}", *lines]
