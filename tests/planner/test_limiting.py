"""Every bound has a scene in which it bites, and one with one thing changed in which it must not.

Both plans have to pass the checker, and the one that is limited is slower or ends earlier.
"""

from __future__ import annotations

import importlib
import re

import numpy as np
import pytest

from slopewise.planner.explain.relaxed import without
from slopewise.planner.explain.what_if import Assumptions
from slopewise.planner.limiting import BOUNDS, Limiting
from slopewise.planner.plan import Status
from tests.world.bound_scenes import SCENES
from tests.world.plans import assert_sound, at, labels
from tests.world.vehicles import model_of, tables_with


def test_no_bound_is_left_out() -> None:
    assert {scene.label for scene in SCENES.values()} == {bound.label for bound in Limiting}
    assert list(BOUNDS) == list(Limiting)


@pytest.mark.parametrize("limiting", Limiting)
def test_what_the_registry_says_of_a_bound_is_there(limiting: Limiting) -> None:
    """Its law can be found, its label and colours can be shown, and a what-if run can lift it."""
    bound = BOUNDS[limiting]
    module, name = bound.law.split(":")
    assert callable(getattr(importlib.import_module(module), name))
    assert bound.meaning
    assert not bound.meaning.endswith(".")
    for colour in (bound.colour, bound.colour_on_dark or bound.colour):
        assert re.fullmatch("#[0-9a-f]{6}", colour)
    model = model_of(tables_with(braking={"sliding_friction": 0.6}))
    assumptions = Assumptions(model=model, uncertainty=None, clear=np.inf)
    lifted = without(limiting, assumptions)
    assert lifted != assumptions
    if bound.lift.out_of_reach or bound.lift.relaxation:
        assert lifted.relax is not None
        assert lifted.relax(model) != model or limiting is Limiting.SPEED_LIMIT


@pytest.mark.parametrize("name", SCENES)
def test_each_bound_bites_and_lets_go(name: str) -> None:
    scene = SCENES[name]
    freed = scene.freed()
    plan, free = scene.bitten(), freed.bitten()
    assert plan.status is scene.status, plan.reason
    assert scene.says in plan.reason
    assert_sound(plan, scene.tables, scene.ground)
    bitten = np.flatnonzero([label == scene.label for label in labels(plan)])
    assert len(bitten) >= scene.share * len(plan.station), labels(plan)
    assert (free.status, free.reason) == (Status.OK, "")
    assert_sound(free, freed.tables, freed.ground)
    # Stopping at the end of the path is a stopping path, and changes of acceleration take time.
    moving = free.speed > 0.5
    if scene.label not in ("stopping_path", "accel", "decel", "jerk"):
        assert scene.label not in np.array(labels(free))[moving]
    if scene.status is Status.BLOCKED:
        assert plan.progress < free.progress - 0.5
    else:
        assert plan.travel_time > 1.01 * free.travel_time
    # Where the bound bites the vehicle is slower than without it.
    slower = [plan.speed[k] <= at(free, plan.station[k], free.speed) + 0.02 for k in bitten]
    assert np.mean(slower) > 0.8
