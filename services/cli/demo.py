"""`slopewise demo`: plans over a generated hill, with a page."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from slopewise.services.cli import options
from slopewise.services.cli.command import echo, print_result, schema_of
from slopewise.services.cli.options import option
from slopewise.services.cli.plan import tables as plan_tables


def demo(
    out: Annotated[Path, option("Where map, paths, plans and report go.", "DIR")] = Path(
        "out/demo"
    ),
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of("jobs.plan_summary.DemoSummary")] = False,
) -> None:
    """Plan a dozen candidates over a generated hill, and write a page with the plans."""
    from slopewise.services.jobs.demo import MODEL, START_SPEED
    from slopewise.services.jobs.demo import demo as job
    from slopewise.services.jobs.plan_summary import summarise
    from slopewise.services.report.plan_page import write_job_page

    result, map_file, path_file = job(out)
    page = out / "report.html"
    write_job_page(page, result, map_file, path_file, MODEL, START_SPEED, math.inf)
    print_result(as_json, summarise(result, page) if as_json else None, plan_tables(result))
    if not as_json:
        echo(f"\nOpen {page} in a browser to see them")
