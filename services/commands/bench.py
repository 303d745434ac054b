"""`slopewise bench`: the planner beside its peers."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console

from models.errors import InputError


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


def _write_plots(figures: list, path: Path) -> None:  # type: ignore[type-arg]
    from plotly.io import to_html

    parts = [
        to_html(figure, full_html=False, include_plotlyjs=(number == 0))
        for number, figure in enumerate(figures)
    ]
    head = "<!doctype html><meta charset='utf-8'><title>slopewise bench</title>"
    path.write_text(head + "\n".join(parts))
