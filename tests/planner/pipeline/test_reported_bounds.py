"""The columns ``speed_bound`` and ``limiting`` of plans, by the checker that knows no planner."""

from __future__ import annotations

import numpy as np

import slopewise
from slopewise.models.candidate_path import CandidatePath
from slopewise.planner.limiting import Limiting
from tests.world.ground import ground_map
from tests.world.vehicles import model_of, tables_with

TOP_HEAVY = tables_with(
    vehicle={"wheelbase": 1.6, "track_width": 1.1, "cg_z": 1.0, "cg_x": 0.5},
    braking={"dead_time": 0.6},
    limits={"min_load": 0.15},
)


def plans(seed: int) -> tuple[slopewise.ElevationMap, list[slopewise.SpeedPlan]]:
    """Two paths with a bend each across hills; a stop before a bend ends in it."""
    rng = np.random.default_rng(seed)
    length, height, turn = rng.uniform(4.0, 12.0), rng.uniform(0.1, 0.4), rng.uniform(0.0, 3.0)

    def hills(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        along = x * np.cos(turn) + y * np.sin(turn)
        return height * np.sin(2.0 * np.pi * along / length) + 0.1 * y * rng.uniform(-1.0, 1.0)

    ground = ground_map(hills, resolution=0.4, x=(-5.0, 25.0), y=(-18.0, 18.0))
    paths = []
    for name in ("left", "right"):
        turned = rng.uniform(0.4, 1.2) * (1.0 if name == "left" else -1.0)
        end = 8.0 + 8.0 * np.cos(turned), 8.0 * np.sin(turned)
        paths.append(CandidatePath(name, np.array([(0.0, 0.0), (8.0, 0.0), end])))
    return ground, slopewise.plan(model_of(TOP_HEAVY), ground, paths, start_speed=0.0)


def false_columns(ground: slopewise.ElevationMap, plan: slopewise.SpeedPlan) -> list[str]:
    report = slopewise.check_plan(plan, model_of(TOP_HEAVY), ground)
    return [v.sentence for v in report.violations if v.kind in ("speed_bound", "limiting")]


def test_bounds_and_their_names_are_true_at_every_station() -> None:
    named: set[int] = set()
    for seed in range(25):
        ground, planned = plans(seed)
        for plan in planned:
            assert false_columns(ground, plan) == [], (seed, plan.candidate)
            at_bound = plan.speed >= plan.speed_bound * (1.0 - 1e-9)
            named.update(plan.limiting[at_bound & (plan.speed > 0.0)].tolist())
    assert Limiting.ROLLOVER in named
