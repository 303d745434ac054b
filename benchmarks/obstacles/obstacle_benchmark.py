"""Obstacles around the limits of two vehicles, planned over and driven in a physics engine."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from rich.console import Console

from slopewise.models.parameters import Model
from slopewise.services.io.model_file import read_model, shipped_models

from ..common.campaign import BenchmarkRequest, Progress
from ..common.text_tables import table_of
from ..common.timing import machine, timed
from . import planned_outcomes
from .cases import cases

CASES, QUICK_CASES = 2400, 240
DRIVES, QUICK_DRIVES = 200, 20
"""Cases and drives of a whole and of a quick run [1]: the latter takes about a minute."""
VEHICLES = ("atv", "husky")
_SEED = 23  # of planned cases; driven ones have the next
_CASES_PER_DRIVE = 4  # enough of passed and of blocked ones

Result = dict[str, Any]


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Plan over all cases, drive some of them."""
    count = QUICK_CASES if request.quick else CASES
    drives = QUICK_DRIVES if request.quick else DRIVES
    advance = progress("obstacles", count + drives)
    models = {name: read_model(shipped_models()[name]) for name in VEHICLES}
    drawn_cases = list(cases(count, models, _SEED))
    seconds, outcomes = timed(lambda: planned_outcomes.outcomes(drawn_cases, models, advance))
    result: Result = {
        "quick": request.quick,
        "machine": machine(),
        "vehicles": list(VEHICLES),
        "planned": {"seconds": seconds, **planned_outcomes.summary(outcomes)},
    }
    if find_spec("mujoco") is not None:
        result["driven"] = _driven(models, drives, advance)
    return result


def _driven(built: dict[str, Model], count: int, advance: Callable[[int], Any]) -> Result:
    """Drives around the limits of the engine's vehicles, over further obstacles."""
    from . import driven_outcomes
    from .engine_limits import measured_in_engine

    models = {name: measured_in_engine(model) for name, model in built.items()}
    drawn_cases = cases(_CASES_PER_DRIVE * count, models, _SEED + 1)
    outcomes = planned_outcomes.outcomes(drawn_cases, models, None)
    limits = {
        name: {"max_step": model.vehicle.max_step, "wheel_travel": model.vehicle.wheel_travel}
        for name, model in models.items()
    }
    drives = driven_outcomes.drives(outcomes, models, built, count, advance)
    return {"limits": limits, **driven_outcomes.summary(drives)}


def show(result: Result, console: Console) -> None:
    """Print the tables of planned and driven obstacles."""
    table = table_of(
        f"obstacles: {result['planned']['all']['cases']} planned",
        "cases",
        "too large",
        "of these passed",
        "small",
        "of these blocked",
        first="kind",
    )
    planned = result["planned"]
    for kind, row in {**planned["kinds"], "all": planned["all"]}.items():
        table.add_row(
            kind,
            str(row["cases"]),
            str(row["too_large"]),
            str(row["passed_though_too_large"]),
            str(row["small"]),
            str(row["barred_though_small"]),
        )
    console.print(table)
    if "driven" not in result:
        console.print("not driven: needs mujoco (pip install '.\\[sim]' in a clone)")
        return
    for name, limits in result["driven"]["limits"].items():
        console.print(
            f"{name} in the engine: steps to {limits['max_step']:.3f} m, one wheel to "
            f"{limits['wheel_travel']:.3f} m"
        )
    table = table_of(
        "obstacles driven", "drives", "struck", "tipped", "in the air", "stuck", "failed"
    )
    for name, label in (
        ("passed", "plan is ok"),
        ("barred", "blocked, driven nevertheless"),
        ("barred_too_large", "of these certainly too large"),
    ):
        row = result["driven"][name]
        keys = ("drives", "struck", "tipped", "wheel_in_the_air", "stuck", "failed")
        table.add_row(label, *(str(row[key]) for key in keys))
    console.print(table)
