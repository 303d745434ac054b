"""`slopewise plan`: the fastest safe speed along candidate paths over an elevation map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.services.cli.check import tables as check_tables
from slopewise.services.cli.command import ExitStatus, command, print_result
from slopewise.services.cli.options import (
    AsJson,
    ClearDistance,
    MapFile,
    ModelFile,
    NoDataValue,
    PathFile,
    Quantile,
    Report,
    Smooth,
    Spacing,
    StartSpeed,
    Topics,
    clear_of,
)
from slopewise.services.cli.tables import LISTED, decimals, line, named, table
from slopewise.services.report.plural import plural

if TYPE_CHECKING:
    from slopewise.planner.explain.explain import Explanation
    from slopewise.planner.plan import SpeedPlan
    from slopewise.services.jobs.plan import PlanResult

_SHOWN_SHARE = 0.25
"""Deviations from the given path above this share of their limit get a line."""

_COLUMNS = (
    "#",
    "candidate",
    "status",
    "time\ns",
    "stops at\nm",
    "top\nm/s",
    "margin\nm",
    "rear\nload",
    "limited by",
)
_COLOURS = {"ok": "green", "blocked": "yellow", "degraded": "magenta", "infeasible": "red"}


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """Options of `slopewise plan`."""

    map_file: MapFile
    path_file: PathFile
    model: ModelFile
    speed: StartSpeed = 0.0
    clear: ClearDistance = None
    spacing: Spacing = None
    quantile: Quantile = 0.999
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Show what the best candidate loses to each bound."),
    ] = False
    smooth: Smooth = True
    solver: Annotated[
        str,
        typer.Option(
            "--solver",
            metavar="NAME",
            help="Solver that limits jerk: interior_point, osqp, or ipopt (exact, slow). "
            "Every plan is verified.",
        ),
    ] = "interior_point"
    topics: Topics = None
    nodata: NoDataValue = None
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="plan.csv",
            help="Write all plans, one row per station; .mcap for Foxglove, .rrd for rerun.",
        ),
    ] = None
    report: Report = None
    check: Annotated[
        bool,
        typer.Option("--check", help="Check the plans as `slopewise check` does, too."),
    ] = False
    as_json: AsJson = False


@command("plan_summary.PlanSummary")
def plan(options: PlanOptions) -> ExitStatus | None:
    """Fastest safe speed along candidate paths over an elevation map.

    Every plan is verified after the solver: from each station, and between them, an emergency stop
    ends before the clear distance with every axle and side loaded. Status 3: no candidate may be
    driven, or --check found a violation.

    [bold]Example[/]  slopewise plan hill.tif paths.csv --model atv --speed 2 --report plan.html
    """
    from slopewise.services.io.no_data import nodata_of
    from slopewise.services.jobs import plan as job
    from slopewise.services.jobs.plan_files import SCENES, check_plan_name, write_plans
    from slopewise.services.jobs.plan_summary import summarise

    settings = job.planner_settings(
        smooth=options.smooth, solver=options.solver, spacing=options.spacing
    )
    uncertainty, nodata = job.uncertainty_at(options.quantile), nodata_of(options.nodata)
    check_plan_name(options.out)
    result = job.plan(
        options.map_file,
        options.path_file,
        options.model,
        start_speed=options.speed,
        clear=clear_of(options.clear),
        settings=settings,
        uncertainty=uncertainty,
        explains=options.explain,
        topics=options.topics,
        nodata=nodata,
        quiet=options.as_json,
    )
    if options.out is not None:
        write_plans(result, options.out)
    if options.report is not None:
        write_page(result, options, options.report)
    if options.check:
        is_scene = options.out is None or options.out.suffix.lower() in SCENES
        result = job.with_check(
            result,
            None if is_scene else options.out,
            clear_of(options.clear),
            quiet=options.as_json,
        )
    summary = summarise(result) if options.as_json else None
    print_result(options.as_json, summary, tables(result), options.out, options.report)
    is_valid = result.check is None or result.check.valid
    return None if result.admissible and is_valid else ExitStatus.NOT_ADMISSIBLE


def write_page(result: PlanResult, options: PlanOptions, path: Path) -> None:
    """Write a page with map, plans and bounds."""
    import time

    from slopewise.planner.kernels.interpreted import is_interpreting
    from slopewise.services.report.plan_page import write_plan_page

    spacing = result.settings.spacing_on(result.elevation_map.resolution)
    facts = {
        "map": str(options.map_file),
        "paths": str(options.path_file),
        "model": f"{result.model.name} ({options.model})",
        "start speed": f"{options.speed:g} m/s",
        "path known to be free": "to its end" if options.clear is None else f"{options.clear:g} m",
        "margins cover": _covered(result),
        "stations every": f"{spacing:g} m",
        "planned in": f"{result.seconds:.2f} s{', not compiled yet' * is_interpreting()}",
        "date": time.strftime("%Y-%m-%d %H:%M"),
    }
    write_plan_page(
        path,
        result.elevation_map,
        result.plans,
        result.model,
        title=f"{options.path_file.stem} on {options.map_file.stem}",
        provenance=facts,
        explanation=result.explanation,
    )


def _covered(result: PlanResult) -> str:
    if result.uncertainty is None:
        return "the model's mean"
    share = f"{100.0 * result.uncertainty.quantile:g} % of the model's uncertainty"
    return share if result.states_uncertainty else f"{share}, which it does not state"


def tables(result: PlanResult) -> Iterator[Any]:
    """Candidates, best first; their reasons; explanation and check."""
    plans = result.plans
    yield from table(
        _COLUMNS,
        (_row(number, plan) for number, plan in enumerate(plans, start=1)),
        title=f"{result.model.name}: {plural(len(plans), 'candidate')}, best first",
        left=("candidate", "status", "limited by"),
        more="more; --out or --json gives all",
    )
    for plan in plans[:LISTED]:
        if plan.reason:
            yield named(plan.candidate, plan.reason)
    for plan in plans[:LISTED]:
        deviation = plan.path_deviation
        if deviation is not None and deviation.largest > _SHOWN_SHARE * deviation.limit:
            yield named(
                plan.candidate,
                f"planned up to {deviation.largest:.2f} m away from the given path, at "
                f"{deviation.station:.2f} m; the limit is {deviation.limit:.3g} m",
            )
    for note in result.notes:
        yield line(note, "dim")
    if result.uncertainty is not None and not result.states_uncertainty:
        yield "The model states no covariance or scatter: --quantile changes little."
    if result.explanation is not None:
        yield from explanation_tables(result.explanation)
    if result.check is not None:
        yield from check_tables(result.check)


def _row(number: int, plan: SpeedPlan) -> tuple[object, ...]:
    import numpy as np

    from slopewise.planner.limiting import Limiting

    moving = plan.limiting[plan.speed > 0.0]
    status = plan.status.value
    return (
        number,
        plan.candidate,
        line(status, _COLOURS[status]),
        f"{plan.travel_time:.2f}",
        f"{plan.progress:.1f}/{plan.station[-1]:.1f}",
        f"{plan.speed.max():.2f}",
        f"{plan.least_margin:.2f}",
        f"{plan.rear_load.min():.0%}",
        Limiting(int(np.bincount(moving).argmax())).label if len(moving) else None,
    )


def explanation_tables(explanation: Explanation) -> Iterator[Any]:
    """Bounds by what they cost, and what to measure next."""
    rows = []
    for cost in explanation.costs:
        stretches = [s for s in explanation.stretches if s.limiting is cost.limiting]
        if stretches or cost.seconds > 0.0:
            times = f" ({len(stretches)} times)" if len(stretches) > 1 else ""
            where = f"{stretches[0].begin:.1f} … {stretches[-1].end:.1f}" if stretches else "–"
            rows.append(
                (
                    cost.limiting.label.replace("_", " "),
                    f"{sum(s.seconds for s in stretches):.2f}",
                    where + times,
                    f"−{cost.seconds:.2f}" if cost.seconds > 0.0 else None,
                    decimals(cost.reach if cost.reach > 0.0 else None, 1),
                )
            )
    yield from table(
        ("bound", "limits\ns", "where\nm", "without it\ns", "farther\nm"),
        rows,
        title=f"Why {explanation.plan.candidate} is not faster",
    )
    useful = [m for m in explanation.measurements if m.seconds > 0.0]
    yield "Measurements, by the time they gain:" if useful else "No measurement helps."
    for measurement in useful:
        yield line(f"  {measurement.sentence}")
