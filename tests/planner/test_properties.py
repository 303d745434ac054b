"""Properties on any ground, of any vehicle: generated scenes pass the checker."""

from __future__ import annotations

import copy
from collections import Counter

import numpy as np
import pytest
from hypothesis import assume, event, given
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import (
    ROUNDING,
    TimeOptimalBatch,
    time_optimal_batch,
)
from slopewise.planner.plan import SpeedPlan, Status
from tests.world import generated
from tests.world.generated import Scene, between, by_day_and_night, complaints
from tests.world.ground import ground_map
from tests.world.vehicles import Tables, model_of

SEEN: Counter[str] = Counter()
FEW = by_day_and_night(10, 500)


def planned(scene: Scene) -> SpeedPlan:
    plan = scene.plan()
    SEEN[plan.status.value] += 1
    event(plan.status.value)
    against = complaints(scene, plan)
    assert not against, "\n".join([f"{plan.status.value} {plan.reason}", *against[:10]])
    return plan


@by_day_and_night(120, 10_000)
@given(scene=generated.scenes())
def test_no_plan_breaks_any_rule(scene: Scene) -> None:
    planned(scene)


def test_all_statuses_were_among_them() -> None:
    """Of the scenes above; without one of a kind the property would not cover it."""
    if not SEEN:
        pytest.skip("runs after the generated scenes only")
    assert {status.value for status in Status} == set(SEEN)
    assert SEEN["ok"] + SEEN["blocked"] > 0.4 * SEEN.total()


def solve(
    tables: Tables, ground: ElevationMap, path: CandidatePath, **options: float
) -> TimeOptimalBatch:
    return time_optimal_batch(ground, batch([path], 0.25), model_of(tables), **options)


def speeds(solved: TimeOptimalBatch) -> np.ndarray:
    return np.sqrt(solved.speed_sq[:, 0])


def never_faster(tight: TimeOptimalBatch, loose: TimeOptimalBatch) -> None:
    """At no station; the looser one may come to rest a station earlier, its profile with it.

    Plans come to rest at stations only, and what is given up between stations moves with the place
    at which they do.
    """
    slow, fast = speeds(tight), speeds(loose)
    assert np.all(slow <= np.maximum(fast, np.append(fast[:1], fast[:-1])) + 0.02)


@st.composite
def drives(draw: st.DrawFn) -> tuple[Tables, ElevationMap, CandidatePath]:
    tables = draw(generated.tables())
    tables["effect"] = draw(generated.effects())
    return (
        tables,
        ground_map(draw(generated.heights()), x=(-8.0, 18.0), y=(-11.0, 11.0)),
        draw(generated.paths(10.0)),
    )


Drive = tuple[Tables, ElevationMap, CandidatePath]


@FEW
@given(drive=drives(), clear=between(0.0, 10.0), more=between(0.0, 5.0))
def test_more_clear_distance_never_makes_it_slower(drive: Drive, clear: float, more: float) -> None:
    near, far = solve(*drive, clear=clear), solve(*drive, clear=clear + more)
    never_faster(near, far)
    assert far.bounds.clear_distance[0] >= near.bounds.clear_distance[0]


@FEW
@given(drive=drives(), weaker=between(0.5, 1.0))
def test_a_weaker_brake_never_makes_it_faster(drive: Drive, weaker: float) -> None:
    tables, ground, path = drive
    # Weaker brakes do unload the rear less: exclude tipping.
    tables["vehicle"]["cg_z"] = 0.05
    worn = copy.deepcopy(tables)
    worn["braking"]["b_b"] *= weaker
    assume(worn["braking"]["b_b"] + min(worn["braking"]["m_b"], 0.0) > 0.2)
    strong, weak = solve(tables, ground, path), solve(worn, ground, path)
    # Friction may cap the better brake only, and stops under a cap are taken a little long.
    never_faster(weak, strong)


@FEW
@given(drive=drives(), edge=between(1.0, 10.0), more=between(0.0, 3.0))
def test_unknown_ground_farther_away_never_makes_it_slower(
    drive: Drive, edge: float, more: float
) -> None:
    tables, ground, path = drive
    first_x = ground.origin[0] + ground.resolution * np.arange(ground.elevation.shape[1])

    def cut(x: float) -> ElevationMap:
        return ElevationMap(
            elevation=np.where(first_x > x, np.nan, ground.elevation),
            resolution=ground.resolution,
            origin=ground.origin,
        )

    near, far = solve(tables, cut(edge), path), solve(tables, cut(edge + more), path)
    never_faster(near, far)


@FEW
@given(drive=drives(), slower=between(0.0, 2.0), faster=between(0.0, 2.0))
def test_a_slower_start_is_never_ahead(drive: Drive, slower: float, faster: float) -> None:
    slower, faster = sorted((slower, faster))
    behind, ahead = solve(*drive, start_speed=slower), solve(*drive, start_speed=faster)
    # A start keeps its v² if the brakes bring down all but this.
    assert np.all(behind.speed_sq <= ahead.speed_sq + ROUNDING)


OF_THE_WORLD = ("headwind", "directional_surface", "surface_patch")
"""Effects that have a place or a direction."""


@FEW
@given(drive=drives())
def test_mirrored_ground_has_the_mirrored_plan(drive: Drive) -> None:
    tables, ground, path = drive
    tables["effect"] = [e for e in tables["effect"] if e["name"] not in OF_THE_WORLD]
    mirrored = ElevationMap(
        elevation=ground.elevation[::-1], resolution=ground.resolution, origin=ground.origin
    )
    flipped = CandidatePath("flipped", path.points * (1.0, -1.0), speed_limit=path.speed_limit)
    here, there = solve(tables, ground, path), solve(tables, mirrored, flipped)
    np.testing.assert_allclose(speeds(there), speeds(here), atol=1e-6)
    np.testing.assert_allclose(there.profile.roll, -here.profile.roll, atol=1e-9)
    np.testing.assert_allclose(there.profile.curvature, -here.profile.curvature, atol=1e-9)
    np.testing.assert_array_equal(there.bounds.barrier, here.bounds.barrier)


@FEW
@given(drive=drives(), quarter=st.integers(1, 3), shift=between(-500.0, 500.0))
def test_turning_and_moving_the_whole_world_changes_nothing(
    drive: Drive, quarter: int, shift: float
) -> None:
    tables, ground, path = drive
    # A limit that changes at a point on a station holds there or not by the point's rounding.
    path = CandidatePath(path.name, path.points)
    tables["effect"] = [e for e in tables["effect"] if e["name"] not in OF_THE_WORLD]
    turned, points = ground, path.points
    for _ in range(quarter):
        x, _, _, y_max = turned.extent
        # A quarter turn to the left about the origin: (x, y) to (−y, x).
        turned = ElevationMap(
            elevation=np.ascontiguousarray(turned.elevation.T[:, ::-1]),
            resolution=turned.resolution,
            origin=(-y_max, x),
        )
        points = np.stack([-points[:, 1], points[:, 0]], axis=1)
    moved = ElevationMap(
        elevation=turned.elevation + 100.0,
        resolution=turned.resolution,
        origin=(turned.origin[0] + shift, turned.origin[1] - shift),
    )
    away = CandidatePath("away", points + np.array([shift, -shift]))
    here, there = solve(tables, ground, path), solve(tables, moved, away)
    # Rounding of the turned points may change a smoothed speed by as much as OSQP's tolerance.
    np.testing.assert_allclose(speeds(there), speeds(here), atol=1e-4)
