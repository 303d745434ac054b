"""`slopewise bench`: the planner beside its peers, its cycles and optimality, the closed loop."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from models.errors import InputError

if TYPE_CHECKING:
    from benchmarks.closed_loop.campaign import Campaign


def run(*, quick: bool, json_file: Path | None, plot: Path | None) -> None:
    """Measure, show, and write what was asked for.

    Raises:
        InputError: plots are wanted and plotly is not installed.
    """
    from benchmarks import planner_speed

    if plot is not None and find_spec("plotly") is None:
        raise InputError("--plot", "", "needs plotly: pip install slopewise[bench]")
    result = planner_speed.run(quick=quick)
    console = Console()
    planner_speed.show(result, console)
    if json_file is not None:
        json_file.write_text(json.dumps(result, indent=1) + "\n")
        console.print(f"wrote {json_file}")
    if plot is not None:
        _write_plots(planner_speed.figures(result), plot)
        console.print(f"wrote {plot}")


def horizon(what: str, *, quick: bool, json_file: Path | None) -> None:
    """Time cycles (`cycle`), or hold smoothed plans against the optimum (`optimality`)."""
    from benchmarks import cycle, optimality
    from services.screen import progress_bar

    module = {"cycle": cycle, "optimality": optimality}[what]
    console = Console()
    with progress_bar(what, module.total(quick)) as advance:
        result = module.run(quick, advance)
    module.show(result, console)
    if json_file is not None:
        json_file.write_text(json.dumps(result, indent=1, allow_nan=False) + "\n")
        console.print(f"wrote {json_file}")


def closed_loop(*, quick: bool, json_file: Path | None, pictures: Path | None) -> None:
    """Learn, drive, show, and write what was asked for.

    Raises:
        InputError: the physics engine is not installed.
    """
    for module in ("mujoco", "matplotlib"):
        if find_spec(module) is None:
            raise InputError("closed-loop", "", f"needs {module}: pip install slopewise[sim]")
    from benchmarks.closed_loop import campaign, tables
    from services.screen import progress_bar

    console = Console()
    with ExitStack() as bars:

        def progress(what: str, total: int) -> Callable[[int], None]:
            bars.close()
            return bars.enter_context(progress_bar(what, total))

        driven = campaign.run(campaign.QUICK if quick else campaign.FULL, progress)
    for table in tables.tables(driven.result):
        console.print(table)
    if json_file is not None:
        json_file.write_text(json.dumps(driven.result, indent=1, allow_nan=False) + "\n")
        console.print(f"wrote {json_file}")
    if pictures is not None:
        _write_pictures(driven, pictures, console)


def _write_pictures(driven: Campaign, folder: Path, console: Console) -> None:
    from benchmarks.closed_loop import pictures
    from benchmarks.closed_loop.film import film
    from benchmarks.closed_loop.moving_horizon import MovingHorizon

    frames = []
    try:
        frames = film(pictures.STRIP, driven.dem, MovingHorizon(driven.model), pictures.FRAMES)
    except RuntimeError as error:
        console.print(f"no frames of the drive: {error}")
    for path in pictures.write(driven, folder, frames):
        console.print(f"wrote {path}")


def _write_plots(figures: list, path: Path) -> None:  # type: ignore[type-arg]
    from plotly.io import to_html

    parts = [
        to_html(figure, full_html=False, include_plotlyjs=(number == 0))
        for number, figure in enumerate(figures)
    ]
    head = "<!doctype html><meta charset='utf-8'><title>slopewise bench</title>"
    path.write_text(head + "\n".join(parts))
