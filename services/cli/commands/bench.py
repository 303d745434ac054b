"""`slopewise bench`: planner beside peers, cycles, optimality, closed loop, effects, obstacles."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rich.console import Console

from slopewise.models.errors import InputError
from slopewise.services.cli.screen import progress_bar

_WIDE = 150  # columns of the widest table


def _benchmark(module: str) -> Any:
    """A module of the benchmarks; they are in `slopewise` when installed, else in the repository.

    Product code knows nothing else of them: this is the one door.
    """
    installed = find_spec("slopewise.benchmarks") is not None
    return import_module(f"{'slopewise.' if installed else ''}benchmarks.{module}")


def run(*, quick: bool, json_file: Path | None, plot: Path | None) -> None:
    """Measure, show, and write what was asked for.

    Raises:
        InputError: plots are wanted and plotly is not installed.
    """
    if plot is not None and find_spec("plotly") is None:
        raise InputError("--plot", "", "needs plotly: pip install '.[bench]' in a clone")
    planner_speed = _benchmark("planner.planner_speed")
    result = planner_speed.run(quick=quick)
    console = Console()
    planner_speed.show(result, console)
    _write_json(result, json_file, console, allow_nan=True)
    if plot is not None:
        _write_plots(planner_speed.figures(result), plot)
        console.print(f"wrote {plot}")


def horizon(what: str, *, quick: bool, json_file: Path | None) -> None:
    """Time cycles (`cycle`), hold plans against the optimum (`optimality`), or bar `obstacles`."""
    module = _benchmark(f"{'obstacles' if what == 'obstacles' else 'planner'}.{what}")
    console = Console()
    with progress_bar(what, module.total(quick)) as advance:
        result = module.run(quick, advance)
    module.show(result, console)
    _write_json(result, json_file, console)


def fleet(*, quick: bool, json_file: Path | None, out: Path | None) -> None:
    """Plan a fleet's worth of paths, show, and write what was asked for.

    Args:
        quick: a small map. json_file: for all figures.
        out: folder with room for the large map; a temporary one if left out.

    Raises:
        InputError: the extra is not installed.
    """
    from tempfile import TemporaryDirectory

    from slopewise.services.fleet.scheduler import check_installed

    check_installed()
    benchmark = _benchmark("fleet.fleet")

    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    console = Console()
    with (
        TemporaryDirectory(prefix="slopewise-fleet-", dir=out) as folder,
        progress_bar("fleet", benchmark.total(quick)) as advance,
    ):
        result = benchmark.run(quick, Path(folder) / "run", advance)
    benchmark.show(result, console)
    _write_json(result, json_file, console)


def discrepancy(
    *,
    quick: bool,
    json_file: Path | None,
    plot: Path | None,
    out: Path | None,
    sets: int | None = None,
    minutes: float | None = None,
) -> None:
    """Hide effects, have them looked for, show, and write what was asked for.

    Args:
        quick: a few sets. json_file: for all figures. plot: page for them.
        out: folder that keeps every outcome; what an interrupted run left in it is not made again.
        sets: at most. minutes: after which no further set is begun.

    Raises:
        InputError: plots are wanted and plotly is not installed, or `out` is a file.
    """
    if plot is not None and find_spec("plotly") is None:
        raise InputError("--plot", "", "needs plotly: pip install '.[bench]' in a clone")
    if out is not None and out.exists() and not out.is_dir():
        raise InputError("--out", str(out), "expected a folder, got a file")
    campaign = _benchmark("discovery.campaign")
    tables = _benchmark("discovery.tables")

    size = campaign.QUICK if quick else campaign.FULL
    if sets is not None:
        size = replace(size, most=sets)
    if minutes is not None:
        size = replace(size, minutes=minutes)
    console = Console()
    with progress_bar("discrepancy", len(campaign.planned(size))) as advance:
        result = campaign.run(size, advance, out)
    console.print(f"{result['sets']} of {result['planned']} sets")
    for table in tables.tables(result):
        console.print(table)
    for missing in campaign.missing():
        console.print(missing)
    _write_json(result, json_file, console)
    if plot is not None:
        _write_plots(_benchmark("discovery.charts").charts(result), plot)
        console.print(f"wrote {plot}")


def closed_loop(*, quick: bool, json_file: Path | None, out: Path | None) -> None:
    """Learn, drive, show, and write what was asked for.

    Args:
        quick: few drives. json_file: for all figures.
        out: folder for report, pictures, and the results of every drive; what an interrupted run
            left in it is not driven again.

    Raises:
        InputError: the physics engine is not installed, or a file cannot be written.
    """
    for module in ("mujoco", "matplotlib"):
        if find_spec(module) is None:
            raise InputError("closed-loop", "", f"needs {module}: pip install '.[sim]' in a clone")
    campaign = _benchmark("closed_loop.campaign")
    tables = _benchmark("closed_loop.tables")

    if out is not None and out.exists() and not out.is_dir():
        raise InputError("--out", str(out), "expected a folder, got a file")
    console = Console(width=max(Console().width, _WIDE))
    with ExitStack() as bars:

        def progress(what: str, total: int) -> Callable[[int], None]:
            bars.close()
            return bars.enter_context(progress_bar(what, total))

        size = campaign.QUICK if quick else campaign.FULL
        driven = campaign.run(size, progress, None if out is None else out / "runs")
    for table in tables.tables(driven.result):
        console.print(table)
    _write_json(driven.result, json_file, console)
    if out is not None:
        _write_closed_loop(driven, out, console)


def _write_closed_loop(driven: Any, folder: Path, console: Console) -> None:
    pictures = _benchmark("closed_loop.pictures")
    frames = []
    try:
        frames = pictures.frames(driven)
    except RuntimeError as error:
        console.print(f"no frames of the drive: {error}")
    drawn = pictures.draw(driven, frames)
    folder.mkdir(parents=True, exist_ok=True)
    for name, picture in drawn.items():
        (folder / f"{name}.png").write_bytes(picture)
    console.print(f"wrote {len(drawn)} pictures to {folder}")


def _write_json(
    result: dict[str, Any], file: Path | None, console: Console, *, allow_nan: bool = False
) -> None:
    if file is not None:
        file.write_text(json.dumps(result, indent=1, allow_nan=allow_nan) + "\n")
        console.print(f"wrote {file}")


def _write_plots(figures: list[Any], path: Path) -> None:
    from plotly.io import to_html

    parts = [
        to_html(figure, full_html=False, include_plotlyjs=(number == 0))
        for number, figure in enumerate(figures)
    ]
    head = "<!doctype html><meta charset='utf-8'><title>slopewise bench</title>"
    path.write_text(head + "\n".join(parts))
