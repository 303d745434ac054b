"""Draw a fan of paths from the middle of a map, plan them, and write a page.

python examples/across_a_dem.py dem.tif [--model atv] [--length 40] [--out out/across]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from slopewise import CandidatePath, SlopewiseError
from slopewise.services.cli.app import main
from slopewise.services.io.map_file import map_info
from slopewise.services.io.path_file import write_paths_csv


def fan(x: float, y: float, length: float, count: int = 8) -> list[CandidatePath]:
    """Gently bending paths from one place into all directions."""
    along = np.arange(0.0, length, 0.5)
    paths = []
    for first in np.linspace(0.0, 2.0 * np.pi, count, endpoint=False):
        heading = first + 0.4 * np.sin(2.0 * np.pi * along / length)
        steps = 0.5 * np.stack((np.cos(heading), np.sin(heading)), axis=1)
        points = np.array((x, y)) + np.cumsum(steps, axis=0)
        paths.append(CandidatePath(f"towards {np.rad2deg(first):.0f}°", points))
    return paths


def run() -> None:
    """Read the arguments, write the paths, hand both to `slopewise plan`."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("map", type=Path)
    parser.add_argument("--model", default="atv")
    parser.add_argument("--length", type=float, default=40.0)
    parser.add_argument("--out", type=Path, default=Path("out/across"))
    arguments = parser.parse_args()
    try:
        x_min, x_max, y_min, y_max = map_info(arguments.map).extent
    except SlopewiseError as error:
        parser.error(str(error))
    arguments.out.mkdir(parents=True, exist_ok=True)
    paths = arguments.out / "paths.csv"
    write_paths_csv(fan(0.5 * (x_min + x_max), 0.5 * (y_min + y_max), arguments.length), paths)
    out = ["--out", str(arguments.out / "plan.csv"), "--report", str(arguments.out / "report.html")]
    main(["plan", str(arguments.map), str(paths), "--model", arguments.model, *out])


if __name__ == "__main__":
    run()
