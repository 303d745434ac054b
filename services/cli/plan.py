"""`slopewise plan`: the fastest safe speed along candidate paths over an elevation map."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.services.cli import options
from slopewise.services.cli.command import ExitStatus, print_result, schema_of
from slopewise.services.cli.options import option, output
from slopewise.services.cli.tables import LISTED, line, table
from slopewise.services.jobs.plural import plural

if TYPE_CHECKING:
    from slopewise.planner.explain.explain import Explanation
    from slopewise.planner.plan import SpeedPlan
    from slopewise.services.jobs.plan import PlanResult

_HEAD = "#|candidate|status|time\ns|stops at\nm|top\nm/s|margin\nm|rear\nload|limited by"
_COLOURS = {"ok": "green", "blocked": "yellow", "degraded": "magenta", "infeasible": "red"}


def plan(
    map_file: options.MapFile,
    path_file: options.PathFile,
    model: options.ModelFile,
    speed: options.StartSpeed = 0.0,
    clear: options.ClearDistance = math.inf,
    spacing: options.Spacing = None,
    quantile: options.Quantile = 0.999,
    explain: Annotated[
        bool, option("Show what the best candidate loses to each bound.", None, "--explain")
    ] = False,
    smooth: options.Smooth = True,
    solver: Annotated[
        str,
        option(
            "Solver that limits jerk: interior_point, osqp, or ipopt (exact, slow). "
            "Every plan is verified.",
            "NAME",
            "--solver",
        ),
    ] = "interior_point",
    topics: options.Topics = None,
    nodata: options.NoDataValue = None,
    out: Annotated[
        Path | None, output("Write all plans, one row per station; .mcap for Foxglove.", "plan.csv")
    ] = None,
    report: options.Report = None,
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of("jobs.plan_summary.PlanSummary")] = False,
) -> ExitStatus | None:
    """Fastest safe speed along candidate paths over an elevation map.

    Every plan is verified after the solver: from each station, and between them, an emergency stop
    ends before the clear distance with every axle and side loaded. Status 3: no candidate may be
    driven.

    [bold]Example[/]  slopewise plan hill.tif paths.csv --model atv --speed 2 --report plan.html
    """
    from slopewise.planner.ground.uncertainty import Uncertainty
    from slopewise.planner.settings import PlannerSettings
    from slopewise.services.io.files import check_ending
    from slopewise.services.jobs import plan as job
    from slopewise.services.jobs.plan_files import ENDINGS, write_plans
    from slopewise.services.jobs.plan_summary import summarise
    from slopewise.services.jobs.summary import from_options

    settings = from_options(PlannerSettings, smooth=smooth, solver=solver, spacing=spacing)
    uncertainty = from_options(Uncertainty, quantile=quantile)
    check_ending(out, *ENDINGS)
    result = job.plan(
        map_file,
        path_file,
        model,
        start_speed=speed,
        clear=clear,
        settings=settings,
        uncertainty=uncertainty,
        explains=explain,
        topics=topics,
        nodata=nodata,
    )
    if out is not None:
        write_plans(result, out)
    if report is not None:
        from slopewise.services.report.plan_page import write_job_page

        write_job_page(report, result, map_file, path_file, model, speed, clear)
    summary = summarise(result) if as_json else None
    print_result(as_json, summary, tables(result), out, report)
    return None if result.admissible else ExitStatus.NOT_ADMISSIBLE


def tables(result: PlanResult) -> Iterator[Any]:
    """Candidates, best first; their reasons; explanation."""
    plans = result.plans
    yield from table(
        _HEAD.split("|"),
        (_row(number, plan) for number, plan in enumerate(plans, start=1)),
        title=f"{result.model.name}: {plural(len(plans), 'candidate')}, best first",
        left=("candidate", "status", "limited by"),
        more="more; --out or --json gives all",
    )
    for plan in plans[:LISTED]:
        if plan.reason:
            yield _named(plan.candidate, plan.reason)
    for plan in plans[:LISTED]:
        if plan.path_deviation is not None and (text := plan.path_deviation.sentence):
            yield _named(plan.candidate, text)
    for path in result.refused:
        yield _named(path.candidate, f"refused: {path.reason}")
    for note in result.notes:
        yield line(note, "dim")
    if result.uncertainty is not None and not result.states_uncertainty:
        yield "The model states no covariance or scatter: --quantile changes little."
    if result.explanation is not None:
        yield from _explanation_tables(result.explanation)


def _named(name: str, text: str) -> Any:
    from rich.text import Text

    return Text.assemble("  ", (name, "bold"), f": {text}")


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


def _explanation_tables(explanation: Explanation) -> Iterator[Any]:
    """Bounds by what they cost, and what to measure next."""
    rows = []
    for cost in explanation.costs:
        stretches = [s for s in explanation.stretches if s.limiting is cost.limiting]
        if not stretches and cost.seconds <= 0.0:
            continue
        times = f" ({len(stretches)} times)" if len(stretches) > 1 else ""
        where = f"{stretches[0].begin:.1f} … {stretches[-1].end:.1f}" if stretches else "–"
        rows.append(
            (
                cost.limiting.label.replace("_", " "),
                f"{sum(s.seconds for s in stretches):.2f}",
                where + times,
                f"−{cost.seconds:.2f}" if cost.seconds > 0.0 else None,
                f"{cost.reach:.1f}" if cost.reach > 0.0 else None,
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
