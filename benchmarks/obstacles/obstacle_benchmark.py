"""Are obstacles barred that the vehicle cannot pass, and only those? Planned, and driven."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from rich.console import Console

from slopewise.models.parameters import Model
from slopewise.services.io.model_file import read_model, shipped_models

from ..common.measure import machine, timed
from ..common.tables import table_of
from . import screening
from .cases import cases

CASES, QUICK_CASES = 2400, 240
DRIVES, QUICK_DRIVES = 200, 20
VEHICLES = ("atv", "husky")
_SEED = 23
_CASES_A_DRIVE = 4
"""Enough of both that are passed and that are barred."""

Result = dict[str, Any]


def total(quick: bool) -> int:
    """Cases and drives together."""
    return QUICK_CASES + QUICK_DRIVES if quick else CASES + DRIVES


def run(quick: bool = False, progress: Callable[[int], None] | None = None) -> Result:
    """Plan over all cases, drive some of them; the result is plain data, ready for JSON."""
    models = {name: read_model(shipped_models()[name]) for name in VEHICLES}
    drawn = list(cases(QUICK_CASES if quick else CASES, models, _SEED))
    seconds, found = timed(lambda: screening.outcomes(drawn, models, progress))
    result: Result = {
        "quick": quick,
        "machine": machine(),
        "vehicles": list(VEHICLES),
        "planned": {"seconds": seconds, **screening.summary(found)},
    }
    if find_spec("mujoco") is not None:
        result["driven"] = _driven(models, QUICK_DRIVES if quick else DRIVES, progress)
    return result


def _driven(built: dict[str, Model], wanted: int, progress: Callable[[int], None] | None) -> Result:
    """Drives around the limits that the engine's vehicles have, over obstacles of their own."""
    from . import driving
    from .limits import measured_in_engine

    models = {name: measured_in_engine(model) for name, model in built.items()}
    drawn = cases(_CASES_A_DRIVE * wanted, models, _SEED + 1)
    found = screening.outcomes(drawn, models, None)
    measured = {
        name: {"max_step": model.vehicle.max_step, "wheel_travel": model.vehicle.wheel_travel}
        for name, model in models.items()
    }
    drives = driving.drives(found, models, built, wanted, progress)
    return {"limits": measured, **driving.summary(drives)}


def show(result: Result, console: Console) -> None:
    """Both tables."""
    table = table_of(
        f"obstacles: {result['planned']['all']['cases']} planned",
        "cases",
        "too large",
        "of these passed",
        "small",
        "of these barred",
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
    for name, words in (
        ("passed", "plan is ok"),
        ("barred", "barred, driven all the same"),
        ("barred_too_large", "of these too large for sure"),
    ):
        row = result["driven"][name]
        keys = ("drives", "struck", "tipped", "wheel_in_the_air", "stuck", "failed")
        table.add_row(words, *(str(row[key]) for key in keys))
    console.print(table)
