"""A wheel sinks into a gap by R − √(R² − (w/2)²), however deep it is; steps keep their height."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

import slopewise
from slopewise.models.arrays import Floats

CASES = [
    ("atv", 0.1),
    ("ugv", 0.25),
    *(
        pytest.param(*c, marks=pytest.mark.nightly)
        for c in (("atv", 0.25), ("husky", 0.1), ("ugv", 0.1))
    ),
]


def refused(
    vehicle: str,
    cell: float,
    heights: Callable[[Floats], Floats],
    turn: float,
    crossing: float = 0.0,
    cliff: float = np.inf,
) -> bool:
    """The checker refuses a slow plan over heights by the distance from their middle [m].

    ``crossing`` is the angle of the path to the direction in which the heights change [rad];
    ``cliff`` the distance of a drop of 1 m to the right of the path [m].
    """
    along = np.arange(0.0, 14.0, cell)
    east, north = np.meshgrid(along, along)
    ahead = (east - 7.0) * math.cos(turn) + (north - 7.0) * math.sin(turn)
    right = (east - 7.0) * math.sin(turn + crossing) - (north - 7.0) * math.cos(turn + crossing)
    ground = slopewise.ElevationMap(
        elevation=heights(ahead) - (right > cliff),
        resolution=cell,
        origin=(0.0, 0.0),
        height_std=0.0,
    )
    s = np.linspace(-4.0, 4.0, 81)
    plan = slopewise.GivenPlan(
        name="over",
        x=7.0 + s * math.cos(turn + crossing),
        y=7.0 + s * math.sin(turn + crossing),
        speed=np.where(s < s[-1], 0.3, 0.0),
    )
    report = slopewise.check_plan(plan, slopewise.read_model(vehicle), ground, quantile=0.5)
    return "step" in {violation.kind for violation in report.violations}


@pytest.mark.parametrize(("vehicle", "cell"), CASES)
def test_gaps_are_as_deep_as_a_wheel_sinks(vehicle: str, cell: float) -> None:
    car = slopewise.read_model(vehicle).vehicle
    radius, limit = car.wheel_radius, car.shape.max_step
    for cells in range(1, 7):
        wide = cells * cell
        sinks = radius - math.sqrt(max(radius**2 - 0.25 * wide**2, 0.0))

        def gap(ahead: Floats, wide: float = wide) -> Floats:
            return np.where((ahead > -0.5 * cell) & (ahead < wide - 0.5 * cell), -2.5 * limit, 0.0)

        if sinks < 0.8 * limit:
            assert not refused(vehicle, cell, gap, 0.0), cells
        elif sinks > 1.15 * limit:
            assert refused(vehicle, cell, gap, 0.0), cells


@pytest.mark.parametrize(
    ("vehicle", "cell"),
    [
        ("atv", 0.05),
        *(pytest.param(*c, marks=pytest.mark.nightly) for c in (("husky", 0.025), ("ugv", 0.05))),
    ],
)
def test_gaps_and_edges_oblique_to_the_path(vehicle: str, cell: float) -> None:
    """A wheel bridges a gap that it crosses obliquely, and falls off an edge there."""
    limit = slopewise.read_model(vehicle).vehicle.shape.max_step

    def gap(ahead: Floats) -> Floats:
        return np.where(np.abs(ahead) < 1.2 * cell, -2.5 * limit, 0.0)

    def edge(ahead: Floats) -> Floats:
        return np.where(ahead > 0.0, -2.5 * limit, 0.0)

    for crossing in (-0.7, 0.5, 0.9):
        assert not refused(vehicle, cell, gap, 0.0, crossing), crossing
        assert refused(vehicle, cell, edge, 0.0, crossing), crossing
    assert refused(vehicle, cell, edge, 0.0, 1.3)


def test_a_cliff_next_to_the_path_is_no_edge_of_a_gap_that_is_bridged() -> None:
    def gap(ahead: Floats) -> Floats:
        return np.where(np.abs(ahead) < 0.06, -0.25, 0.0)

    assert not refused("atv", 0.05, gap, 0.0, 0.9, 1.35)
    assert refused("atv", 0.05, gap, 0.0, 0.9, 0.5)


def test_a_gap_before_unknown_ground_is_bridged_and_an_edge_is_not() -> None:
    def gap(ahead: Floats) -> Floats:
        return np.where(np.abs(ahead) < 0.06, -0.25, np.where(ahead > 0.4, np.nan, 0.0))

    def edge(ahead: Floats) -> Floats:
        return np.where(ahead > 0.4, np.nan, np.where(ahead > 0.0, -0.25, 0.0))

    assert not refused("atv", 0.05, gap, 0.0)
    assert refused("atv", 0.05, edge, 0.0)


@pytest.mark.parametrize(("heading", "is_refused"), [(0.35, False), (0.0, True), (-0.35, True)])
def test_a_vehicle_may_leave_the_edge_under_a_wheel(heading: float, is_refused: bool) -> None:
    """At first the middle of its rear right wheel is beyond the middle of an edge of 1 m."""
    model, cell = slopewise.read_model("atv"), 0.05
    car = model.vehicle
    edge = -0.5 * (car.wheelbase * math.sin(heading) + car.track_width * math.cos(heading))
    south = edge - 60.4 * cell
    _, north = np.meshgrid(-3.0 + cell * np.arange(180), south + cell * np.arange(160))
    ground = slopewise.ElevationMap(
        elevation=np.where(north > edge, 0.0, -1.0),
        resolution=cell,
        origin=(-3.0, south),
        height_std=0.0,
    )
    s = np.linspace(0.0, 3.0, 61)
    plan = slopewise.GivenPlan(
        name="leaving",
        x=s * math.cos(heading),
        y=s * math.sin(heading),
        speed=np.where(s < s[-1], 0.3, 0.0),
    )
    report = slopewise.check_plan(plan, model, ground, quantile=0.5)
    assert ("step" in {violation.kind for violation in report.violations}) is is_refused


@pytest.mark.parametrize(("vehicle", "cell"), CASES)
@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_steps_up_and_down_count_on_any_slope(vehicle: str, cell: float, turn: float) -> None:
    limit = slopewise.read_model(vehicle).vehicle.shape.max_step
    for sign in (-1.0, 1.0):
        for slope in (0.0, 0.1):

            def step(ahead: Floats, high: float, slope: float = slope) -> Floats:
                return slope * ahead + np.where(ahead > 0.0, high, 0.0)

            high = 1.5 if sign * slope >= 0.0 else 2.0  # a slope against it hides part of a step
            assert refused(
                vehicle, cell, lambda a, s=sign, f=step, h=high: f(a, s * h * limit), turn
            )
            assert not refused(vehicle, cell, lambda a, s=sign, f=step: f(a, s * 0.7 * limit), turn)


@pytest.mark.parametrize(
    ("cell", "before", "after", "share"), [(0.1, -0.15, 0.15, 1.6), (0.05, -0.2, 0.2, 1.7)]
)
def test_a_step_at_the_foot_of_a_slope_is_no_gap(
    cell: float, before: float, after: float, share: float
) -> None:
    """Ground falls before it, and rises behind it; without it that is driven."""

    def heights(ahead: Floats, step: float) -> Floats:
        ground = np.where(ahead < 0.0, before * ahead, after * np.minimum(ahead, 2.0))
        return ground + step * (ahead > 0.0)

    highest = slopewise.read_model("atv").vehicle.shape.max_step
    assert refused("atv", cell, lambda ahead: heights(ahead, share * highest), 0.0)
    assert not refused("atv", cell, lambda ahead: heights(ahead, 0.0), 0.0)
