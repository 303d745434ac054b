"""Plans on public elevation models: all pass the checker, most move, some are blocked."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.io.model_file import read_model, shipped_models
from slopewise.services.io.plan_file import driven
from tests.world.real_terrain import CASES, PLACES, candidates, ground_of


def plans_on(place: str, vehicle: str, data: Path, every: int) -> list[SpeedPlan]:
    """Plans of a share of the candidates: from rest, rolling, fast, and into fog."""
    ground, model = ground_of(place, data), read_model(shipped_models()[vehicle])
    paths = candidates(place, ground, seed=CASES.index((place, vehicle)))[::every]
    planner, top = CandidatePlanner(model), model.limits.speed
    starts = ({}, {"start_speed": 0.3 * top}, {"start_speed": 0.7 * top})
    return [
        plan
        for share, options in enumerate((*starts, {"clear": PLACES[place].lengths[0] / 3.0}))
        for plan in planner.plan(ground, paths[share::4], **options)
    ]


NIGHTLY = (pytest.mark.nightly, pytest.mark.timeout(3600))


@pytest.mark.parametrize(
    ("place", "vehicle", "every", "checked"),
    [
        *((*case, 2, 10) for case in CASES[::2]),
        *(pytest.param(*case, 1, 1, marks=NIGHTLY) for case in CASES),
    ],
)
def test_plans_pass_the_checker_and_more_than_half_of_them_move(
    place: str, vehicle: str, every: int, checked: int, data: Path
) -> None:
    plans = plans_on(place, vehicle, data, every)
    model, ground = read_model(shipped_models()[vehicle]), ground_of(place, data)
    for plan in plans[::checked]:
        report = check_plan_on_map(plan_of_columns(driven(plan)), model, ground)
        assert report.valid is (plan.status is not Status.INFEASIBLE), report.violations[:3]
    count = Counter(plan.status for plan in plans)
    assert count[Status.BLOCKED] > 0.1 * len(plans)
    assert np.mean([plan.progress > 1.0 for plan in plans]) > (0.4 if place == "Colmenar" else 0.5)
    # Fallbacks are rare: a start that is too fast for its ground is one.
    assert count[Status.DEGRADED] + count[Status.INFEASIBLE] < 0.35 * len(plans)
    # A crest makes the bound step from station to station: smoothing may find no way then.
    assert sum("not smoothed" in plan.reason for plan in plans) <= 0.02 * len(plans)


@pytest.mark.parametrize(
    ("place", "size", "percentiles"),
    [
        ("TM1", (1000.0, 1000.0), (5.0, 21.0, 31.0)),
        ("giswqs", (400.0, 400.0), (11.0, 23.0, 27.0)),
        ("Colmenar", (8.0, 8.0), (7.0, 20.0, 36.0)),
    ],
)
def test_the_maps_are_read_in_metres(
    place: str, size: tuple[float, float], percentiles: tuple[float, ...], data: Path
) -> None:
    """Against what is known of them; a wrong unit or resolution would show in the slopes."""
    ground = ground_of(place, data)
    x_min, x_max, y_min, y_max = ground.extent
    assert (x_max - x_min, y_max - y_min) == pytest.approx(size, rel=0.02)
    north, east = np.gradient(ground.elevation, ground.resolution)
    steep = np.rad2deg(np.arctan(np.hypot(north, east)))
    slopes = np.percentile(steep[np.isfinite(steep)], (50, 95, 99))
    np.testing.assert_allclose(slopes, percentiles, atol=1.5)


def test_the_order_of_rows_does_not_decide_about_safety(data: Path) -> None:
    """The text grid does not say which row is north: mirrored ground gives the mirrored plans."""
    ground = ground_of("Colmenar", data)
    mirrored = ElevationMap(
        elevation=ground.elevation[::-1], resolution=ground.resolution, origin=ground.origin
    )
    _, _, y_min, y_max = ground.extent
    planner = CandidatePlanner(read_model(shipped_models()["husky"]))
    for path in candidates("Colmenar", ground, seed=7)[:4]:
        flipped = path.points * (1.0, -1.0) + (0.0, y_min + y_max)
        (here,) = planner.plan(ground, [path])
        (there,) = planner.plan(mirrored, [CandidatePath(path.name, flipped)])
        assert here.status is there.status
        np.testing.assert_allclose(there.speed, here.speed, atol=2e-3)
        np.testing.assert_allclose(there.roll, -here.roll, atol=1e-6)
