"""Preparation of forked commands: modules imported, one plan and page drawn.

Imported by the server that forks them only. It starts no thread and opens no
session, and imports nothing that an extra brings, so that a forked command still lacks what its
page has not asked for.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path

import slopewise.services.daemon.daemon  # noqa: F401
from examples import made_up
from slopewise.services.cli import app
from slopewise.services.io.table import write_csv

_STOPS = 6  # no log may have fewer


def _do_once(folder: Path) -> None:
    made_up.write_map(folder / "dem.tif")
    made_up.write_paths_csv(made_up.paths(), folder / "paths.csv")
    log = made_up.stops(_STOPS)
    runs = [f"{run:.0f}" for run in log.pop("run")]
    write_csv({"run": runs, **log}, folder / "drive.csv")
    given = [str(folder / "dem.tif"), str(folder / "paths.csv"), "--model", "atv"]
    pages = ["--out", str(folder / "plan.csv"), "--report", str(folder / "plan.html")]
    learned = ["--out", str(folder / "mine.toml"), "--report", str(folder / "stops.html")]
    for arguments in (
        ["plan", *given, *pages],
        ["check", pages[1], "--map", given[0], *given[2:]],
        ["calibrate", str(folder / "drive.csv"), "--model", "atv", *learned],
    ):
        app.app(args=arguments, prog_name="slopewise", standalone_mode=False)
    import slopewise.services.jobs.discrepancy
    import slopewise.services.jobs.provenance
    import slopewise.services.report.brake_sheet  # noqa: F401


with tempfile.TemporaryDirectory() as place, contextlib.redirect_stdout(io.StringIO()):
    _do_once(Path(place))
