"""Less certainty about the current ground never makes a plan faster."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.terrain.observation import Features
from slopewise.models.terrain.resistances import TerrainEstimate
from slopewise.models.terrain.surfaces import model_on
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from tests.planner import generated
from tests.planner.generated import between
from tests.planner.scenes import ground_map, model_of


def speeds(model: Model, ground: ElevationMap, path: CandidatePath) -> np.ndarray:
    survived = Uncertainty()
    solved = time_optimal_batch(
        ground, batch([path], 0.25), survived.cautious(model), uncertainty=survived
    )
    return np.sqrt(solved.speed_sq[:, 0])


@settings(max_examples=60)
@given(
    tables=generated.tables(),
    heights=generated.heights(),
    path=generated.paths(10.0),
    level=st.sampled_from([0.5, 0.8, 1.0]),
    value=between(0.0, 0.3),
    std=between(0.0, 0.1),
    more=between(0.01, 0.2),
)
def test_a_vague_motion_resistance_never_makes_it_faster(
    tables: dict,
    heights: object,
    path: CandidatePath,
    level: float,
    value: float,
    std: float,
    more: float,
) -> None:
    model = model_of(tables)
    model = replace(model, braking=replace(model.braking, level=level))
    ground = ground_map(heights, x=(-8.0, 18.0), y=(-11.0, 11.0))
    fast, slow = (
        speeds(model_on(model, Features(motion_resistance=TerrainEstimate(value, s))), ground, path)
        for s in (std, std + more)
    )
    # Plans come to rest at stations only, and what is given up moves with the one where they do.
    assert np.all(slow <= np.maximum(fast, np.append(fast[:1], fast[:-1])) + 0.02)
