"""Digests of the files that a result was made from."""

from __future__ import annotations

import hashlib
from datetime import datetime
from importlib import metadata
from pathlib import Path

from slopewise.models.parameters import Model
from slopewise.services.io.files import sha256_of
from slopewise.services.io.model_file import find_model, model_sha256
from slopewise.services.jobs.log_input import LogInput

_LISTED = 6
"""Logs that have a line each; more would not fit on the brake sheet."""


def calibration_digests(
    logs: LogInput, prior: str, model: Model, out: Path | None = None
) -> list[str]:
    """Lines with the SHA-256 of logs, map, prior, and of the calibrated model, written to `out`."""
    digests = [(path.name, sha256_of(path)) for path in logs.files]
    lines = [f"log {digest}  {name}" for name, digest in digests[:_LISTED]]
    if more := digests[_LISTED:]:
        listing = "\n".join(f"{digest}  {name}" for name, digest in digests) + "\n"
        total = hashlib.sha256(listing.encode()).hexdigest()
        lines.append(f"    {total}  of the lines '<sha256>  <name>' of all, {len(more)} more")
    prior_file = find_model(prior)
    lines.append(f"old {sha256_of(prior_file)}  {prior_file.name}, the model so far")
    written = out.name if out else "not written"
    digest = sha256_of(out) if out else model_sha256(model)
    lines.append(f"new {digest}  {written}, the model of this sheet")
    if logs.map_file is not None:
        lines.append(f"map {sha256_of(logs.map_file)}  {logs.map_file.name}")
    moment = f"{datetime.now():%Y-%m-%d %H:%M}"
    return [f"sha256; slopewise {metadata.version('slopewise')}, written {moment}", *lines]
