"""What bars candidates on a given map: shares by hazard, and a picture of where.

Run it as ``python -m benchmarks.obstacles.on_maps MAP VEHICLE [PICTURE.png]``; MAP is what
``slopewise plan --map`` reads, VEHICLE a model file or the name of a shipped one.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.limiting import BOUNDS, Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.io.map_file import read_map
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.report.relief import shade

_CANDIDATES = 400
_SEED = 5
_LENGTH = (6.0, 30.0)
_OF_THE_MAP = 0.25


class OnMap(NamedTuple):
    """Plans of drawn candidates on a map, and which bound ends each that is blocked."""

    ground: ElevationMap
    plans: list[SpeedPlan]
    ends: Counter[str]


def drawn(ground: ElevationMap) -> list[CandidatePath]:
    """Arcs on known ground, from anywhere in any direction; the same for the same map."""
    rng = np.random.default_rng(_SEED)
    x_min, x_max, y_min, y_max = ground.extent
    length = float(np.clip(_OF_THE_MAP * min(x_max - x_min, y_max - y_min), *_LENGTH))
    rows, columns = np.nonzero(np.isfinite(ground.elevation))
    paths = []
    for n in range(_CANDIDATES):
        at = rng.integers(len(rows))
        x = ground.origin[0] + columns[at] * ground.resolution
        y = ground.origin[1] + rows[at] * ground.resolution
        s = np.arange(0.0, length, 0.2)
        yaw = rng.uniform(-np.pi, np.pi) + rng.uniform(-0.1, 0.1) * s
        steps = 0.2 * np.column_stack([np.cos(yaw), np.sin(yaw)])
        paths.append(CandidatePath(f"{n}", np.array([x, y]) + np.cumsum(steps, axis=0)))
    return paths


def plans_on(ground: ElevationMap, model: Model) -> OnMap:
    """Plan all of them, and count what ends them."""
    plans = CandidatePlanner(model).plan(ground, drawn(ground))
    ends = Counter(_end_of(plan) for plan in plans)
    return OnMap(ground, plans, ends)


def _end_of(plan: SpeedPlan) -> str:
    if plan.status is Status.OK:
        return "none"
    if plan.obstacle is not None:
        return plan.obstacle.bound.label
    return Limiting(int(plan.limiting[-1])).label


def picture(found: OnMap, path: Path) -> None:
    """Relief, candidates and what ends them, each obstacle where it is."""
    import matplotlib.pyplot as plt

    ground, x = found.ground, found.ground.extent
    half = 0.5 * ground.resolution
    figure, axes = plt.subplots(figsize=(11.0, 9.0), layout="constrained")
    axes.imshow(
        shade(ground.elevation, ground.resolution)[..., 0],
        cmap="gray",
        vmin=0,
        vmax=255,
        extent=(x[0] - half, x[1] + half, x[2] - half, x[3] + half),
    )
    for plan in found.plans:
        moving = plan.speed > 0.0
        axes.plot(plan.x[moving], plan.y[moving], color="#2a78d6", linewidth=0.8)
        if plan.obstacle is not None:
            colour = BOUNDS[plan.obstacle.bound].colour
            axes.plot(plan.obstacle.x, plan.obstacle.y, "^", color=colour, markersize=5.0)
    total = len(found.plans)
    words = ", ".join(f"{name} {count / total:.0%}" for name, count in found.ends.most_common())
    axes.set(title=words, xlabel="x [m]", ylabel="y [m]", aspect="equal")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main(arguments: list[str]) -> dict[str, Any]:
    """Read, plan, count; a picture where one is wanted."""
    ground, vehicle = read_map(Path(arguments[0])), arguments[1]
    found = plans_on(ground, read_model(find_model(vehicle)))
    if len(arguments) > 2:
        picture(found, Path(arguments[2]))
    return {name: count / len(found.plans) for name, count in found.ends.most_common()}


if __name__ == "__main__":
    for name, share in main(sys.argv[1:]).items():
        print(f"{name:20} {share:.1%}")
