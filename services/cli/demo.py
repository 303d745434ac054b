"""`slopewise demo`: plans over a generated hill, with a page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.services.cli.command import command, print_result
from slopewise.services.cli.options import AsJson
from slopewise.services.cli.plan import PlanOptions, write_page
from slopewise.services.cli.plan import tables as plan_tables
from slopewise.services.cli.tables import line

if TYPE_CHECKING:
    from slopewise.services.jobs.plan import PlanResult


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
    print_result(options.as_json, summary, _tables(result, page))


def _tables(result: PlanResult, page: Path) -> Iterator[Any]:
    yield from plan_tables(result)
    yield ""
    address = line(f"Open {page} in a browser to see them")
    address.no_wrap = True
    yield address
