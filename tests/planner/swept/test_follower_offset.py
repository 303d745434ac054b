"""A vehicle on the polyline that was given, next to the planned line, touches nothing either."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from tests.world.vehicles import ATV, model_of

MODEL = model_of(ATV)
CORNER = np.array([[-6.0, 0.0], [0.0, 0.0], [0.0, 6.0]])
ARC = np.linspace(-6.0, 6.0, 121)
CURVE = np.stack([ARC, 20.0 - np.sqrt(400.0 - ARC**2)], axis=1)
CELL = 0.05


def ground(x: float, y: float) -> ElevationMap:
    """Level ground with a post of 0.2 m at a place [m]."""
    along = np.arange(-9.0, 9.0, CELL)
    east, north = np.meshgrid(along, along)
    post = (np.abs(east - x) < 0.1) & (np.abs(north - y) < 0.1)
    return ElevationMap(elevation=np.where(post, 1.0, 0.0), resolution=CELL, origin=(-9.0, -9.0))


FREE = ground(8.0, -8.0)


def on_corner(s: float) -> np.ndarray:
    return np.array([min(s - 6.0, 0.0), max(s - 6.0, 0.0)])


def touched_by_follower(post: ElevationMap) -> bool:
    """A rectangle in the middle of the polyline, along its chord of a wheelbase, is over a post."""
    shape, half = MODEL.vehicle.shape, 0.5 * MODEL.vehicle.wheelbase
    v, u = np.nonzero(post.elevation > 0.5)
    x, y = u * CELL - 9.0, v * CELL - 9.0
    for s in np.arange(1.0, 11.0, 0.02):
        chord, middle = on_corner(s + half) - on_corner(s - half), on_corner(s)
        ahead = chord / np.hypot(*chord)
        along = (x - middle[0]) * ahead[0] + (y - middle[1]) * ahead[1]
        across = (y - middle[1]) * ahead[0] - (x - middle[0]) * ahead[1]
        inside = (along < shape.front) & (along > -shape.rear)
        if (inside & (np.abs(across) < 0.5 * shape.width)).any():
            return True
    return False


def test_a_post_that_only_the_follower_of_a_corner_touches_blocks_its_plan_and_check() -> None:
    planner, path = CandidatePlanner(MODEL), CandidatePath("corner", CORNER)
    line = planner.plan(FREE, [path])[0]
    on_line = CandidatePath("line", np.stack([line.x, line.y], axis=1))
    reported = plan_of_columns(line.columns())
    alone = {name: v for name, v in line.columns().items() if name != "path_deviation"}
    post = ground(0.4, -0.7)
    assert touched_by_follower(post)
    blocked, driven = planner.plan(post, [path, on_line])
    assert blocked.status.value == "blocked"
    assert driven.status.value == "ok"
    assert not check_plan_on_map(reported, MODEL, post).valid
    assert check_plan_on_map(plan_of_columns(alone), MODEL, post).valid
    assert planner.plan(ground(0.8, -0.85), [path])[0].status.value == "ok"
    assert check_plan_on_map(reported, MODEL, FREE).valid


def test_paths_on_their_line_do_not_depend_on_others_next_to_them() -> None:
    planner = CandidatePlanner(MODEL)
    curve, corner = CandidatePath("curve", CURVE), CandidatePath("corner", CORNER)
    alone, together = planner.plan(FREE, [curve]), planner.plan(FREE, [curve, corner])
    for name in ("x", "y", "speed", "clear_distance", "stop_distance"):
        np.testing.assert_array_equal(getattr(alone[0], name), getattr(together[0], name))
    assert alone[0].reason == together[0].reason


def test_negative_deviations_of_a_plan_are_refused() -> None:
    plan = CandidatePlanner(MODEL).plan(FREE, [CandidatePath("corner", CORNER)])[0]
    columns = dict(plan.columns())
    columns["path_deviation"] = np.full(len(plan.x), -0.1)
    with pytest.raises(ValueError, match=r"path_deviation\[0\].*a distance >= 0"):
        plan_of_columns(columns)
