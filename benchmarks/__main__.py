"""One benchmark by its name: ``python -m benchmarks cycle --quick --json cycle.json``."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from .common.campaign import BenchmarkRequest

BENCHMARKS: dict[str, tuple[str, tuple[str, ...]]] = {
    "planner": ("planner.planner_speed", ()),
    "cycle": ("planner.cycle_time", ()),
    "growth": ("planner.growth", ()),
    "optimality": ("planner.optimality", ()),
    "closed-loop": ("closed_loop.loop_campaign", ("mujoco",)),
    "discrepancy": ("discrepancy.naming_benchmark", ()),
    "fleet": ("fleet.fleet_benchmark", ("dask", "pyarrow")),
    "margins": ("calibration.margins", ()),
    "streams": ("calibration.streams", ()),
    "obstacles": ("obstacles.obstacle_benchmark", ()),
    "guard": ("guard.guard_benchmark", ()),
    "paths": ("paths.paths_benchmark", ()),
    "noise": ("noisy_maps.noisy_map_benchmark", ()),
    "tracking": ("tracking.tracking_benchmark", ()),
    "drives": ("tracking.engine_drives", ("mujoco",)),
}
"""Modules with ``run(request, progress)`` and ``show(result, console)``; packages they need."""

_WIDTH = 150  # columns of the widest table


def benchmark(name: str) -> Any:
    return import_module(f".{BENCHMARKS[name][0]}", __package__)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a benchmark, print its tables, write its figures."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.sets is not None and options.sets < 1:
        parser.error(f"--sets: expected at least 1, got {options.sets}")
    if not options.minutes >= 0.0:
        parser.error(f"--minutes: expected at least 0, got {options.minutes:g}")
    for package in BENCHMARKS[options.what][1]:
        if find_spec(package) is None:
            parser.error(f"{options.what} needs the package {package}, which is not installed")
    if options.out is not None and options.out.exists() and not options.out.is_dir():
        parser.error(f"--out: expected a folder, got the file {options.out}")
    if options.json is not None and not os.access(options.json.resolve().parent, os.W_OK):
        parser.error(f"--json: expected a file in a writable folder, got {options.json}")
    console = Console(width=max(Console().width, _WIDTH))
    request = BenchmarkRequest(options.quick, options.out, options.sets, options.minutes)
    module = benchmark(options.what)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    bar = Console(stderr=True)
    with Progress(
        *columns, TimeElapsedColumn(), console=bar, disable=not bar.is_terminal
    ) as display:

        def progress(title: str, total: int) -> Callable[[int], None]:
            if display.disable:
                print(f"{title}: {total} steps …", file=sys.stderr, flush=True)
            task = display.add_task(title, total=total)
            return lambda count: display.advance(task, count)

        result = module.run(request, progress)
    module.show(result, console)
    if options.json is not None:
        options.json.write_text(json.dumps(result, indent=1) + "\n")
        console.print(f"wrote {options.json}")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """End with status 2 and one line."""
        self.exit(2, f"{self.prog}: {message}\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="slopewise bench", description=__doc__)
    parser.add_argument("what", nargs="?", choices=BENCHMARKS, default="planner")
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures as JSON")
    out = "closed-loop, discrepancy: store results, from which an interrupted run resumes; "
    out += "fleet: folder with space for the map"
    parser.add_argument("--out", type=Path, metavar="DIR", help=out)
    parser.add_argument("--sets", type=int, metavar="N", help="discrepancy: at most N logs")
    minutes = "discrepancy: start no further log after M minutes"
    parser.add_argument("--minutes", type=float, metavar="M", default=math.inf, help=minutes)
    return parser


if __name__ == "__main__":
    main()
