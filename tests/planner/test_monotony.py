"""Tighter limits, and less knowledge, never make a profile faster: at any station, from any start.

To 1e-6 m/s, except the service deceleration. Inherent, of 100 random scenes each:

- Rough ground is tried at four speeds, the highest of them the speed limit: a lower one tries
  others (4 scenes, up to 0.49 m/s). Here it does not count.
- A plan that the verifier objects to is repaired in steps of 2 % (1 scene, 0.02 m/s), and smoothing
  gives a place the jerk that another leaves.
- An emergency stop of a plan that is infeasible holds its speed in the dead time, where one that
  brakes hard in time begins immediately.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, time_optimal_batch
from tests.planner.test_properties import Drive, drives, solve, speeds
from tests.world.generated import between, by_day_and_night
from tests.world.vehicles import Tables, model_of

STARTS = st.one_of(st.just(0.0), between(0.0, 6.0))
SOME = by_day_and_night(10, 1000)


def nowhere_faster(tight: TimeOptimalBatch, loose: TimeOptimalBatch, by: float = 0.0) -> None:
    np.testing.assert_array_less(speeds(tight), (1.0 + by) * speeds(loose) + 1e-6)


def changed(tables: Tables, table: str, **values: object) -> Tables:
    out = copy.deepcopy(tables)
    out[table].update(values)
    return out


@SOME
@pytest.mark.parametrize("name", ["speed", "accel", "lateral_accel", "min_load", "dead_time"])
@given(drive=drives(), share=between(0.2, 1.0), start=STARTS)
def test_a_tighter_limit(name: str, drive: Drive, share: float, start: float) -> None:
    tables, *scene = drive
    tables = changed(tables, "limits", vertical_accel=100.0)
    table = "braking" if name == "dead_time" else "limits"
    value, more = tables[table][name], {"min_load": 0.3, "dead_time": 0.4}.get(name)
    tighter = value + (1.0 - share) * more if more else share * value
    tight = changed(tables, table, **{name: tighter})
    # What is slower in a turn loses less load over a crest there: stops from before it are shorter.
    by = 0.01 if name == "lateral_accel" else 0.0
    slow, fast = (solve(each, *scene, start_speed=start) for each in (tight, tables))
    nowhere_faster(slow, fast, by)


@SOME
@given(drive=drives(), share=between(0.3, 1.0), start=STARTS)
def test_a_lower_deceleration(drive: Drive, share: float, start: float) -> None:
    """A plan that brakes less in a dead time lets a stop be slower on a crest behind it.

    There it keeps more of its load and its brakes: the crest may be passed faster by that much.
    """
    tables, *scene = drive
    decel = tables["limits"]["decel"]
    tight = changed(tables, "limits", decel=share * decel)
    slow, fast = (solve(each, *scene, start_speed=start) for each in (tight, tables))
    less = decel * (1.0 - share) * float(slow.ground.dead_time.max())
    assert np.all(speeds(slow) <= speeds(fast) + less + 1e-6)


@SOME
@given(drive=drives(), factor=between(1.0, 9.0), start=STARTS)
def test_more_covariance(drive: Drive, factor: float, start: float) -> None:
    (tables, ground, path), careful = drive, Uncertainty()
    known = np.diag([1e-4, 9e-4, 4e-6, 4e-5])
    less, more = (
        time_optimal_batch(
            ground,
            batch([path], 0.25),
            careful.cautious(model_of(changed(tables, "braking", covariance=tuple(map(tuple, c))))),
            start_speed=start,
            uncertainty=careful,
        )
        for c in (known.tolist(), (factor * known).tolist())
    )
    nowhere_faster(more, less)


@SOME
@given(drive=drives(), seed=st.integers(0, 1000), share=between(0.0, 0.01), start=STARTS)
def test_fewer_known_cells(drive: Drive, seed: int, share: float, start: float) -> None:
    tables, ground, path = drive
    heights = ground.elevation.copy()
    heights[np.random.default_rng(seed).random(heights.shape) < share] = np.nan
    less = ElevationMap(elevation=heights, resolution=ground.resolution, origin=ground.origin)
    slow, fast = (solve(tables, known, path, start_speed=start) for known in (less, ground))
    nowhere_faster(slow, fast)
