"""The band around a line blocks at least where a line within it does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.input_errors import InputErrors
from slopewise.planner.limiting import Limiting
from slopewise.planner.swept.hazards import Hazards, swept_hazards
from tests.world.hazards import MODELS, rough_ground
from tests.world.stages import profile_of

BAND = 0.25
"""Distance to either side [m]."""

ONLY_STEPS = (Limiting.UNKNOWN_TERRAIN, Limiting.CLEARANCE, Limiting.BODY)


def first_blocked(hazards: Hazards) -> tuple[int, str]:
    """Index of the first blocked station and its message; the count where none is."""
    code = hazards.rows.code[:, 0]
    k = int(np.argmax(code > 0)) if code.any() else len(code)
    obstacle = hazards.obstacle(0, k) if k < len(code) else None
    return k, "" if obstacle is None else obstacle.words


@pytest.mark.parametrize("resolution", [0.1, 0.2])
def test_a_step_on_any_line_of_the_band_blocks_the_band(resolution: float) -> None:
    blocked, freely = 0, 0
    for seed in range(60):
        rng, model = np.random.default_rng(seed), MODELS[0]
        scene = rough_ground(seed, resolution, model.vehicle.wheel_radius)
        scene = replace(scene, elevation=np.nan_to_num(scene.elevation))
        start, end = np.array([[1.5, rng.uniform(2.5, 3.5)], [10.0, rng.uniform(2.5, 3.5)]])
        normal = np.array([start[1] - end[1], end[0] - start[0]])
        normal /= np.hypot(*normal)
        lines = []
        for shift in (0.0, -BAND, -0.5 * BAND, 0.5 * BAND, BAND):
            path = CandidatePath("shifted", np.array([start, end]) + shift * normal)
            profile = profile_of(model, scene, path, spacing=resolution)
            lines.append(first_blocked(swept_hazards(scene, profile, model, lifted=ONLY_STEPS)))
            if shift == 0.0:
                errors = InputErrors(cross_track=BAND)
                band = swept_hazards(scene, profile, model, errors=errors, lifted=ONLY_STEPS)
        # The outermost lines are always checked; those between within a cell of one that is.
        for k, message in (lines[0], lines[1], lines[-1]):
            if "in the air" not in message:  # four wheels together are checked on the line alone
                assert first_blocked(band)[0] <= k, (seed, message)
        blocked += first_blocked(band)[0] < lines[0][0]
        freely += not first_blocked(band)[1]
    assert blocked >= 5
    assert freely >= 5
