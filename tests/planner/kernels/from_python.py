"""Plan from Python in all ways that differ in types; print kernels that were not compiled ahead.

`python -m tests.planner.kernels.from_python`
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

import slopewise
from slopewise.models.parameters import Effect
from slopewise.planner.kernels.ahead import described, written_down
from slopewise.planner.kernels.borrowing import Borrowing
from slopewise.planner.settings import PlannerSettings
from tests.planner.kernels.signatures_now import called_by_python, name_of

EFFECTS = (
    Effect(name="headwind", parameters={"wind": 2, "direction": 1, "c": 1}),
    Effect(name="crest_unloading", parameters={"k": 1}),
)


def maps() -> list[slopewise.ElevationMap]:
    """Level in whole numbers, rough in single precision and by columns, of two surfaces."""
    y, x = np.indices((100, 100))
    hills = 1.5 * np.sin(x / 18.0) + 0.9 * np.cos(y / 16.0)
    given = {"resolution": 1, "origin": (0, 0), "height_std": 0}
    return [
        slopewise.ElevationMap(elevation=np.zeros((100, 100), np.int64), **given),
        slopewise.ElevationMap(elevation=np.asfortranarray(hills, np.float32), **given),
        slopewise.ElevationMap(
            elevation=hills,
            terrain_class=(x > 30).astype(np.int8),
            class_names=("", "sand"),
            **given,
        ),
    ]


def models() -> list[slopewise.Model]:
    """With and without surfaces, effects, brakes on one axle, and whole numbers as limits."""
    shipped = [slopewise.read_model(name) for name in ("atv", "husky", "ugv")]
    atv = shipped[0]
    hull = replace(atv.braking, speed_by_grade=((-1, 4), (1, 4)), sliding_friction=1)
    calibrated = replace(atv, braking=hull, limits=replace(atv.limits, speed=4, decel=2, jerk=2))
    axle = replace(atv, vehicle=replace(atv.vehicle, front_brake_share=1))
    return [*shipped, calibrated, axle, *(replace(atv, effect=(effect,)) for effect in EFFECTS)]


def main() -> None:
    """Plan, then look which signatures came up."""
    ways = [np.array([[10, 50], [30, 50], [60, 54]]), np.array([[10.0, 50.0], [60.0, 50.0]])]
    paths = [slopewise.CandidatePath(f"{i}", way) for i, way in enumerate(ways)]
    settings = [None, PlannerSettings(smooth=False, spacing=1), PlannerSettings(margin_weight=1)]
    for model in models():
        for ground in maps():
            for chosen, quantile in zip(settings, (0.999, None, 0.5), strict=True):
                plans = slopewise.plan(
                    model,
                    ground,
                    paths,
                    start_speed=1,
                    clear=30,
                    quantile=quantile,
                    settings=chosen,
                )
                slopewise.check_plan(plans[0], model, ground)
            horizon = slopewise.Horizon(model)
            for x in (10, 11):
                state = slopewise.PlanarState(x=x, y=50, heading=0, speed=1)
                horizon.step(state, paths, ground, clear=30)
    known = written_down()
    for kernel in called_by_python():
        if isinstance(kernel, Borrowing):
            # Python calls it, so it is compiled once more, in every process.
            if "_for_python" in vars(kernel):
                print(name_of(kernel), "from Python")
            continue
        for kinds in kernel.overloads:
            signature = json.loads(json.dumps([described(kind) for kind in kinds]))
            if kernel.stats.cache_hits + kernel.stats.cache_misses and signature not in known.get(
                name_of(kernel), []
            ):
                print(name_of(kernel), json.dumps(signature))


if __name__ == "__main__":
    main()
