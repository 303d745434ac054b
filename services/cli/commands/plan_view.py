"""What `slopewise plan` shows: a table, JSON, a page."""

from __future__ import annotations

import time
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from slopewise.models.parameters import Braking, Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.kernels.interpreted import is_interpreting
from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.cli.commands import check_view, explain_view
from slopewise.services.cli.commands.plan import MadeFrom, PlanJob, PlanResult
from slopewise.services.io.files import sha256_of
from slopewise.services.io.plan_file import driven, summary
from slopewise.services.report.plan_labels import plural

_SHOWN_SHARE = 0.25
"""Deviations from the given path above this share of their limit get a line."""

STATUS_STYLE = {
    Status.OK: "green",
    Status.BLOCKED: "yellow",
    Status.DEGRADED: "magenta",
    Status.INFEASIBLE: "red",
}


def write_page(result: PlanResult, job: PlanJob, path: Path) -> None:
    """A page that shows map, plans and bounds; works without a network."""
    from slopewise.services.report.plan_page import write_plan_page

    clear = "whole path" if np.isinf(job.clear) else f"{job.clear:g} m"
    facts = {
        "map": str(job.map_file),
        "paths": str(job.path_file),
        "model": f"{result.model.name} ({job.model_file})",
        "start speed": f"{job.start_speed:g} m/s",
        "way known free": clear,
        "survives": _survives(job.uncertainty, result.model),
        "stations every": f"{job.settings.spacing_on(result.elevation_map.resolution):g} m",
        "planned in": f"{result.seconds:.2f} s{', not compiled yet' * is_interpreting()}",
        "date": time.strftime("%Y-%m-%d %H:%M"),
    }
    title = f"{job.path_file.stem} on {job.map_file.stem}"
    write_plan_page(
        path,
        result.elevation_map,
        result.plans,
        result.model,
        title=title,
        provenance=facts,
        explanation=result.explanation,
    )


def _survives(uncertainty: Uncertainty | None, model: Model) -> str:
    if uncertainty is None:
        return "the model's mean"
    share = f"{100.0 * uncertainty.quantile:g} % of what the model leaves open"
    return share if _leaves_open(model) else f"{share}, which it does not state"


def _leaves_open(model: Model) -> bool:
    """Does the model say how uncertain it is?"""
    tables: tuple[Braking | SurfaceBraking, ...] = (model.braking, *model.braking.terrain.values())
    stated = (t.covariance or t.force_std or t.force_scatter or t.dead_time_std for t in tables)
    return any(stated) or any(effect.covariance for effect in model.effect)


def as_json(result: PlanResult) -> dict[str, Any]:
    """Plans for machines: a summary and the columns of each, best first."""
    found = result.explanation
    explained = {} if found is None else {"explain": explain_view.as_json(found)}
    judged = {} if result.check is None else {"check": check_view.as_json(result.check)}
    return {
        "model": result.model.name,
        "admissible": result.admissible,
        "seconds": result.seconds,
        **({} if result.made_from is None else {"made_from": _made_from(result.made_from)}),
        "notes": list(result.notes),
        "plans": [
            {
                **summary(plan),
                "path_deviation": _path_deviation(plan),
                **_momentum(plan),
                "columns": _columns(plan),
            }
            for plan in result.plans
        ],
        **explained,
        **judged,
    }


def _made_from(files: MadeFrom) -> dict[str, Any]:
    """By what files the plans are found to have been made years later; ages in seconds."""
    return {
        "slopewise": metadata.version("slopewise"),
        "map_id": files.map_file.name,
        "map_age": max(time.time() - files.map_file.stat().st_mtime, 0.0),
        "map_hash": sha256_of(files.map_file),
        "model_id": files.model_file.name,
        "model_hash": sha256_of(files.model_file),
    }


def _path_deviation(plan: SpeedPlan) -> dict[str, float] | None:
    """How far the plan leads from the path that was given [m]."""
    told = plan.path_deviation
    keys = ("largest", "station", "x", "y", "limit")
    return None if told is None else {key: getattr(told, key) for key in keys}


def _momentum(plan: SpeedPlan) -> dict[str, Any]:
    """What a hill takes that thrust alone cannot climb; empty where none ends the plan."""
    found = plan.momentum
    if found is None:
        return {}
    needed = found.least_speed > 0.0
    told = {
        "station": found.station,
        "speed": found.speed,
        "until": found.until,
        "allowed": found.allowed,
        "stations": plan.station[needed].tolist(),
        "least_speed": found.least_speed[needed].tolist(),
    }
    return {"momentum": told}


def _columns(plan: SpeedPlan) -> dict[str, Any]:
    repeated = ("candidate", "status", "reason")
    return {
        name: values if isinstance(values, list) else values.tolist()
        for name, values in driven(plan).items()
        if name not in repeated
    }


def show(result: PlanResult, console: Console, most: int = 30) -> None:
    """The table of candidates, best first."""
    table = Table(
        title=f"{result.model.name}: {plural(len(result.plans), 'candidate')}, best first",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column("#", justify="right", no_wrap=True, min_width=2)
    table.add_column("candidate", no_wrap=True, max_width=18)
    table.add_column("status", no_wrap=True)
    for title in ("time\ns", "stops at\nm", "top\nm/s", "margin\nm", "rear\nload"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("limited by", no_wrap=True)
    for number, plan in enumerate(result.plans[:most], start=1):
        style = STATUS_STYLE[plan.status]
        table.add_row(
            str(number),
            Text(plan.candidate),
            f"[{style}]{plan.status.value}[/]",
            f"{plan.travel_time:.2f}",
            f"{plan.progress:.1f}/{plan.station[-1]:.1f}",
            f"{plan.speed.max():.2f}",
            f"{plan.least_margin:.2f}",
            f"{plan.rear_load.min():.0%}",
            _limited_most(plan),
        )
    console.print(table)
    if len(result.plans) > most:
        console.print(f"… and {len(result.plans) - most} more; --out or --json gives all")
    for plan in result.plans[:most]:
        if plan.reason:
            line = Text.assemble((plan.candidate, "bold"), f": {plan.reason}")
            console.print(Padding(line, (0, 0, 0, 2)))
    for plan in result.plans[:most]:
        if sentence := _deviation_sentence(plan):
            line = Text.assemble((plan.candidate, "bold"), f": {sentence}")
            console.print(Padding(line, (0, 0, 0, 2)))
    for note in result.notes:
        console.print(Text(note), style="dim")
    if result.uncertainty is not None and not _leaves_open(result.model):
        console.print("The model states no covariance or scatter: --quantile changes little.")
    if result.explanation is not None:
        explain_view.show(result.explanation, console)
    if result.check is not None:
        check_view.show(result.check, console)


def _deviation_sentence(plan: SpeedPlan) -> str:
    """How far the plan leads from the path that was given, empty where that is little."""
    told = plan.path_deviation
    if told is None or told.largest <= _SHOWN_SHARE * told.limit:
        return ""
    return (
        f"planned up to {told.largest:.2f} m away from the given path, at {told.station:.2f} m; "
        f"the limit is {told.limit:.3g} m"
    )


def _limited_most(plan: SpeedPlan) -> str:
    moving = plan.limiting[plan.speed > 0.0]
    if len(moving) == 0:
        return "–"
    return Limiting(int(np.bincount(moving).argmax())).label
