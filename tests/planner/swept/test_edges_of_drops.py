"""Drops next to a path and across it, and the rim of a map: where wheels and body may be."""

from __future__ import annotations

import numpy as np
import pytest

import slopewise

LENGTH = 26.0  # of the square map [m]


def ground_with_drop(cell: float) -> tuple[slopewise.ElevationMap, float]:
    """Level ground, 1 m lower beyond the cells whose middle is at the returned y [m]."""
    cells = round(LENGTH / cell)
    y = np.tile(cell * np.arange(cells)[:, None], (1, cells))
    edge = cell * (cells // 2)
    heights = np.where(y < edge - 1e-9, -1.0, 0.0)
    return slopewise.ElevationMap(elevation=heights, resolution=cell, origin=(0.0, 0.0)), edge


@pytest.mark.parametrize("cell", [pytest.param(0.05, marks=pytest.mark.nightly), 0.1])
@pytest.mark.parametrize("name", ["atv", "husky", "ugv"])
def test_wheels_stop_before_a_drop_at_any_angle(name: str, cell: float) -> None:
    model = slopewise.read_model(name)
    vehicle, (ground, edge) = model.vehicle, ground_with_drop(cell)
    corners = 0.5 * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    driven = 0
    for degrees in (2.0, 7.0, 20.0, 45.0, 90.0):
        turned = np.radians(-degrees)
        begin = 8.0, edge + 0.5 * vehicle.track_width + 0.05 + 6.0 * np.sin(-turned)
        way = np.linspace(0.0, 12.0, 60)[:, None] * (np.cos(turned), np.sin(turned))
        path = slopewise.CandidatePath("p", begin + way)
        (plan,) = slopewise.plan(model, ground, [path], start_speed=0.0)
        if not plan.speed.any():  # the map is too coarse for this vehicle to drive there
            continue
        driven += 1
        assert plan.status.value == "blocked"
        assert slopewise.check_plan(plan, model, ground).valid, degrees
        end = (plan.station + plan.stop_distance)[plan.speed > 0.0].max()
        y = np.interp(end, plan.station, plan.y)
        wheels = corners @ (
            vehicle.wheelbase * np.sin(turned),
            vehicle.track_width * np.cos(turned),
        )
        assert (y + wheels).min() >= edge - 0.01, degrees
        assert (y + wheels).min() <= edge + 1.5, degrees
    assert driven >= 3


@pytest.mark.parametrize("cell", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 57.0])
def test_a_map_ends_where_unknown_cells_would_begin(cell: float, degrees: float) -> None:
    """A front overhang is over known ground at rest; a ring of unknown cells changes nothing."""
    model = slopewise.read_model("ugv")
    cells = round(40.0 / cell)
    level, half = np.zeros((cells, cells // 2)), 0.5 * cell
    turned, last = np.radians(degrees), (cells // 2 - 1) * cell
    begin = np.array([last - 10.0 * np.cos(turned), 20.0 - 10.0 * np.sin(turned)])
    way = np.linspace(0.0, 20.0, 60)[:, None] * (np.cos(turned), np.sin(turned))
    path = slopewise.CandidatePath("p", begin + way)
    ends = []
    for ring in (0, 2):
        ground = slopewise.ElevationMap(
            elevation=np.pad(level, ring, constant_values=np.nan),
            resolution=cell,
            origin=(-ring * cell, -ring * cell),
        )
        (plan,) = slopewise.plan(model, ground, [path], start_speed=0.0)
        ends.append(plan.clear_distance)
        front, side = model.front, 0.5 * model.vehicle.shape.width
        x = np.interp(plan.clear_distance, plan.station, plan.x)
        assert x + front * np.cos(turned) + side * np.sin(turned) <= last + half + 0.01
    assert ends[0] == pytest.approx(ends[1])
