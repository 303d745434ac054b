"""Plans on public elevation models: all pass the checker, most move, some are blocked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.check.check_report import Violation
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.io.map_file import read_map
from slopewise.services.io.model_file import read_model, shipped_models
from slopewise.services.io.plan_file import driven

CANDIDATES = 200
SHARE = 10
"""Every tenth candidate is checked in the everyday run, all of them at night."""


def read_text_grid(path: Path, offset: Path) -> ElevationMap:
    """Rows of heights on a 0.1 m grid, and the coordinates of its first cell.

    The rows are taken as they come, the first at minimum y. The files do not say whether that is
    south or north; slopes are the same either way, and so are plans on the mirrored map.
    """
    x, y = np.loadtxt(offset)
    return ElevationMap(elevation=np.loadtxt(path), resolution=0.1, origin=(float(x), float(y)))


@dataclass(frozen=True)
class Place:
    """One elevation model and the candidates that suit its size."""

    files: tuple[str, ...]
    read: Callable[..., ElevationMap]
    lengths: tuple[float, float]
    curvature: float
    vehicles: tuple[str, ...]


PLACES = {
    "TM1": Place(("TM1_564_146.tif",), read_map, (15.0, 40.0), 0.12, ("atv", "husky", "ugv")),
    "giswqs": Place(("giswqs_dem.tif",), read_map, (15.0, 40.0), 0.12, ("atv", "husky", "ugv")),
    "Colmenar": Place(
        ("ColmenarRocks_Nominal_10cmDEM.csv", "ColmenarRocks_Nominal_10cmOffset.csv"),
        read_text_grid,
        (5.0, 7.0),
        0.3,
        ("husky",),
    ),
}
CASES = [(place, vehicle) for place, p in PLACES.items() for vehicle in p.vehicles]
_READ: dict[str, ElevationMap] = {}
_PLANNED: dict[tuple[str, str], list[SpeedPlan]] = {}


def ground_of(place: str, data: Path) -> ElevationMap:
    files = [data / "dem" / name for name in PLACES[place].files]
    for file in files:
        if not file.is_file():
            pytest.skip(f"no elevation model at {file}")
    if place not in _READ:
        _READ[place] = PLACES[place].read(*files)
    return _READ[place]


def candidates(place: str, ground: ElevationMap, seed: int) -> list[CandidatePath]:
    """Random clothoids towards the inside of the map."""
    rng = np.random.default_rng(seed)
    x_min, x_max, y_min, y_max = ground.extent
    centre = 0.5 * np.array([x_min + x_max, y_min + y_max])
    spread = 0.45 * np.array([x_max - x_min, y_max - y_min])
    paths = []
    for i in range(CANDIDATES):
        start = centre + rng.uniform(-spread, spread)
        inward = np.arctan2(*(centre - start)[::-1])
        length = rng.uniform(*PLACES[place].lengths)
        first, last = rng.uniform(-PLACES[place].curvature, PLACES[place].curvature, 2)
        s = np.linspace(0.0, length, int(length / 0.2))
        yaw = inward + rng.uniform(-0.8, 0.8) + first * s + (last - first) * s**2 / (2.0 * length)
        steps = np.diff(s)[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)[1:]
        points = start + np.concatenate([[(0.0, 0.0)], np.cumsum(steps, axis=0)])
        paths.append(CandidatePath(f"{place}-{i}", points))
    return paths


def plans_on(place: str, vehicle: str, data: Path) -> list[SpeedPlan]:
    """Plans of all candidates, a quarter of them each from rest, rolling, fast, and into fog."""
    if (place, vehicle) not in _PLANNED:
        ground, model = ground_of(place, data), read_model(shipped_models()[vehicle])
        paths = candidates(place, ground, seed=CASES.index((place, vehicle)))
        planner, top = CandidatePlanner(model), model.limits.speed
        _PLANNED[place, vehicle] = [
            plan
            for share, options in enumerate(
                (
                    {},
                    {"start_speed": 0.3 * top},
                    {"start_speed": 0.7 * top},
                    {"clear": PLACES[place].lengths[0] / 3.0},
                )
            )
            for plan in planner.plan(ground, paths[share::4], **options)
        ]
    return _PLANNED[place, vehicle]


def violations_of(plans: list[SpeedPlan], place: str, vehicle: str, data: Path) -> list[Violation]:
    """Violations of plans as files hold them."""
    model, ground = read_model(shipped_models()[vehicle]), ground_of(place, data)
    return [
        violation
        for plan in plans
        for violation in check_plan_on_map(plan_of_columns(driven(plan)), model, ground).violations
    ]


@pytest.mark.parametrize(("place", "vehicle"), CASES)
def test_a_share_of_plans_passes_the_checker(place: str, vehicle: str, data: Path) -> None:
    plans = plans_on(place, vehicle, data)
    assert len(plans) == CANDIDATES
    assert violations_of(plans[::SHARE], place, vehicle, data) == []


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("place", "vehicle"), CASES)
def test_every_plan_passes_the_checker(place: str, vehicle: str, data: Path) -> None:
    assert violations_of(plans_on(place, vehicle, data), place, vehicle, data) == []


@pytest.mark.parametrize(("place", "vehicle"), CASES)
def test_real_ground_is_drivable_and_blocks_too(place: str, vehicle: str, data: Path) -> None:
    """The plans above say something: most of them move, and not all reach the end."""
    plans = plans_on(place, vehicle, data)
    count = Counter(plan.status for plan in plans)
    assert count[Status.BLOCKED] > 20
    assert np.mean([plan.progress > 1.0 for plan in plans]) > (0.4 if place == "Colmenar" else 0.5)
    # Fallbacks are rare: a start that is too fast for its ground is one.
    assert count[Status.DEGRADED] + count[Status.INFEASIBLE] < 0.35 * len(plans)
    # A crest makes the bound step from station to station: smoothing may find no way then.
    assert sum("not smoothed" in plan.reason for plan in plans) <= 0.02 * len(plans)


def slopes(ground: ElevationMap) -> np.ndarray:
    north, east = np.gradient(ground.elevation, ground.resolution)
    steep = np.rad2deg(np.arctan(np.hypot(north, east)))
    return steep[np.isfinite(steep)]


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
    np.testing.assert_allclose(np.percentile(slopes(ground), (50, 95, 99)), percentiles, atol=1.5)


def test_the_order_of_rows_does_not_decide_about_safety(data: Path) -> None:
    """The text grid does not say which row is north: mirrored ground gives the mirrored plans."""
    ground = ground_of("Colmenar", data)
    mirrored = ElevationMap(
        elevation=ground.elevation[::-1], resolution=ground.resolution, origin=ground.origin
    )
    _, _, y_min, y_max = ground.extent
    planner = CandidatePlanner(read_model(shipped_models()["husky"]))
    for path in candidates("Colmenar", ground, seed=7)[:10]:
        flipped = path.points * (1.0, -1.0) + (0.0, y_min + y_max)
        (here,) = planner.plan(ground, [path])
        (there,) = planner.plan(mirrored, [CandidatePath(path.name, flipped)])
        assert here.status is there.status
        np.testing.assert_allclose(there.speed, here.speed, atol=2e-3)
        np.testing.assert_allclose(there.roll, -here.roll, atol=1e-6)
