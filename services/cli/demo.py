"""`slopewise demo`: plans over a generated hill, with a page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from slopewise.services.cli.command import command, print_result
from slopewise.services.cli.options import AsJson
from slopewise.services.cli.plan import PlanOptions, write_page
from slopewise.services.cli.plan import tables as plan_tables


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """Options of `slopewise demo`."""

    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where map, paths, plans and report go.")
    ] = Path("out/demo")
    as_json: AsJson = False


@command("plan_summary.DemoSummary")
def demo(options: DemoOptions) -> None:
    """Plan a dozen candidates over a generated hill, and write a page with the plans."""
    from slopewise.services.jobs.demo import MODEL, START_SPEED
    from slopewise.services.jobs.demo import demo as job
    from slopewise.services.jobs.plan_summary import summarise_demo

    result, map_file, path_file = job(options.out, quiet=options.as_json)
    page = options.out / "report.html"
    write_page(result, PlanOptions(map_file, path_file, MODEL, speed=START_SPEED), page)
    summary = summarise_demo(result, page) if options.as_json else None
    print_result(options.as_json, summary, plan_tables(result))
    if not options.as_json:
        typer.echo(f"\nOpen {page} in a browser to see them")
