"""The previous plan from cycle to cycle: the same stations, up to the first that is not free."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.horizon.polyline import Polyline, station_of
from slopewise.planner.horizon.previous_plan import BEHIND, OfferedStations, PreviousPlan
from slopewise.planner.path import PathBatch, batch
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from tests.planner.scenes import arc, ground_map, model_of, plane, straight, tables_with


def planned_along(path: CandidatePath, **options: object) -> PreviousPlan:
    model = model_of(tables_with())
    ground = plane(0.05, y=(-20.0, 20.0))
    (plan,) = CandidatePlanner(model).plan(ground, [path])
    return PreviousPlan(plan, None, Polyline(*np.empty((2, 0))))


def later(previous: PreviousPlan, i: int) -> PreviousPlan:
    """The same drive, with its plan beginning at station i."""
    plan = previous.plan
    names = [n for n in SpeedPlan.__dataclass_fields__ if isinstance(getattr(plan, n), np.ndarray)]
    values = {n: getattr(plan, n) for n in SpeedPlan.__dataclass_fields__}
    values |= {n: values[n][i:] for n in names}
    early = slice(max(i - BEHIND, 0), i)
    limit = None if previous.speed_limit is None else previous.speed_limit[i:]
    return PreviousPlan(SpeedPlan(**values), limit, Polyline(plan.x[early], plan.y[early]))


def test_speed_and_time_between_stations_follow_from_v_squared() -> None:
    previous = planned_along(straight(20.0))
    plan = previous.plan
    for share in (0.0, 0.3, 0.99):
        x = plan.x[7] + share * (plan.x[8] - plan.x[7])
        projection = previous.locate((x, 0.0), 0.0)
        v = np.sqrt((1.0 - share) * plan.speed[7] ** 2 + share * plan.speed[8] ** 2)
        assert previous.speed_at(projection)[0] == pytest.approx(v)
        way = share * (plan.station[8] - plan.station[7])
        assert previous.station_at(projection) == pytest.approx(plan.station[7] + way)
        expected = plan.time[7] + way / (0.5 * (v + plan.speed[7]))
        assert previous.time_at(projection) == pytest.approx(expected)


def test_the_rest_holds_two_stations_behind_and_so_the_same_ground() -> None:
    """Grade, roll and curvature of the stations ahead are the same numbers as before."""
    ground = ground_map(lambda x, y: 0.4 * np.sin(x) * np.cos(0.7 * y), y=(-20.0, 20.0))
    path = batch([arc(20.0, 0.15)], 0.25)
    model = model_of(tables_with())
    size = model.vehicle.wheelbase, model.vehicle.track_width
    complete = terrain_profile(ground, path.x, path.y, path.count, *size)
    (plan,) = CandidatePlanner(model).plan(ground, [arc(20.0, 0.15)])
    previous = PreviousPlan(plan, None, Polyline(*np.empty((2, 0))))
    for i in (0, 1, 2, 3, 30):
        path_limit = later(previous, i)
        for _ in range(2):  # and once more, with nothing driven in between
            projection = path_limit.locate(
                (float(path_limit.plan.x[0]), float(path_limit.plan.y[0])), 0.15 * 0.25 * i
            )
            rest, first = path_limit.rest(projection)
            assert first == min(i, BEHIND)
            again = terrain_profile(ground, rest.x, rest.y, rest.count, *size)
            # With two stations behind, the neighbour of the first one is unchanged, too.
            for name in ("grade", "sin_roll", "curvature", "z"):
                before = getattr(complete, name)[i:, 0]
                assert np.array_equal(getattr(again, name)[first:, 0], before)
            if i >= BEHIND:
                assert again.grade[first - 1, 0] == complete.grade[i - 1, 0]
            path_limit = later(path_limit, 0) if first == 0 else path_limit


def test_a_path_continues_with_the_stations_beyond_its_end() -> None:
    previous = planned_along(arc(10.0, 0.1))
    longer = batch([arc(16.0, 0.1)], 0.25)
    x, y = longer.x[:, 0], longer.y[:, 0]
    projection = previous.locate((float(x[8]), float(y[8])), 0.2)
    path, first = previous.going_on(
        projection, OfferedStations(Polyline(x[8:], y[8:]), None), extended=True
    )
    steps = np.hypot(np.diff(path.x[:, 0]), np.diff(path.y[:, 0]))
    assert steps == pytest.approx(np.full(len(steps), 0.25), rel=0.02)
    assert (path.x[-1, 0], path.y[-1, 0]) == (x[-1], y[-1])
    assert first == BEHIND
    same, _ = previous.going_on(
        projection, OfferedStations(Polyline(x[8:], y[8:]), None), extended=False
    )
    assert (same.x[-1, 0], same.y[-1, 0]) == (previous.plan.x[-1], previous.plan.y[-1])


def test_a_full_circle_is_extended_at_its_end_and_not_where_it_passes_its_start() -> None:
    around = 2.0 * np.pi / 0.4
    previous = planned_along(arc(0.9 * around, 0.4))
    twice = batch([arc(1.9 * around, 0.4)], 0.25)
    x, y = twice.x[:, 0], twice.y[:, 0]
    projection = previous.locate((0.0, 0.0), 0.0)
    assert previous.agrees(projection, Polyline(x, y), 0.1)
    path, _ = previous.going_on(projection, OfferedStations(Polyline(x, y), None), extended=True)
    length = Polyline(path.x[:, 0], path.y[:, 0]).arc()[-1]
    assert length == pytest.approx(1.9 * around, rel=0.02)


def test_limits_of_the_offered_path_hold_on_the_driven_stations() -> None:
    previous = planned_along(straight(10.0))
    x = np.arange(2.1, 14.0, 0.25)
    limit = np.where(x > 6.0, 1.0, np.inf)
    projection = previous.locate((2.1, 0.0), 0.0)
    path, _ = previous.going_on(
        projection, OfferedStations(Polyline(x, np.zeros_like(x)), limit), extended=True
    )
    assert path.speed_limit is not None
    path_limit = path.speed_limit[:, 0]
    assert np.all(path_limit[path.x[:, 0] > 5.86] == 1.0)
    assert np.all(np.isinf(path_limit[path.x[:, 0] < 5.8]))


@pytest.mark.parametrize(
    ("candidate", "same"),
    [
        (arc(12.0, 0.1), True),
        (arc(9.0, 0.1), True),
        (arc(20.0, 0.1), True),
        (arc(12.0, 0.105), False),
        (straight(12.0), False),
    ],
)
def test_the_same_path_is_distinguished_from_another(candidate: CandidatePath, same: bool) -> None:
    previous = planned_along(arc(12.0, 0.1))
    path = batch([candidate], 0.2)
    projection = previous.locate((0.0, 0.0), 0.0)
    assert previous.agrees(projection, Polyline(path.x[:, 0], path.y[:, 0]), 0.1) == same


def test_a_place_is_found_again_exactly_whatever_was_driven() -> None:
    path = batch([arc(20.0, 0.08)], 0.25)
    x, y = path.x[:, 0], path.y[:, 0]
    points, station = Polyline(x, y), 1.03 * Polyline(x, y).arc()
    for end in (3.0, 7.77, 15.123):
        far = float(np.interp(end, station, x)), float(np.interp(end, station, y))
        assert station_of(points, station, far, end + 0.4) == pytest.approx(end, abs=1e-9)
        rest = Polyline(x[9:], y[9:])
        projected = station_of(rest, station[9:] - station[9], far, end - station[9])
        assert projected == pytest.approx(end - station[9], abs=1e-9)
    assert station_of(points, station, (float(x[-1]), float(y[-1])), station[-1]) == np.inf
    assert station_of(points, station, (0.0, 50.0), 90.0) == np.inf
    assert station_of(points, station, (-5.0, 0.0), -5.0) == 0.0


def test_a_place_off_the_path_is_no_farther_than_its_foot() -> None:
    """Obstacles seen from a path 10 cm outside of a turn are not farther away on this one."""
    inner = batch([arc(15.0, 0.2)], 0.25)
    x, y = inner.x[:, 0], inner.y[:, 0]
    outer_x, outer_y = 5.1 * np.sin(2.0), 5.0 - 5.1 * np.cos(2.0)
    station = Polyline(x, y).arc()
    projected = station_of(Polyline(x, y), station, (float(outer_x), float(outer_y)), 5.1 * 2.0)
    assert projected == pytest.approx(10.0, abs=0.01)


def test_paths_of_a_plan_are_contiguous_batches() -> None:
    previous = planned_along(straight(10.0))
    rest, _ = previous.rest(previous.locate((3.0, 0.0), 0.0))
    assert isinstance(rest, PathBatch)
    assert rest.x.flags.c_contiguous
    assert rest.names == ("straight",)
