"""The driven path from cycle to cycle: the same stations, the same place, as far as it is free."""

from __future__ import annotations

import numpy as np
import pytest

from planner.ground.terrain_profile import terrain_profile
from planner.horizon.continuation import BEHIND, Driven, Points, reached
from planner.path import CandidatePath, PathBatch, batch
from planner.pipeline.candidates import CandidatePlanner
from planner.plan import SpeedPlan
from tests.planner.scenes import arc, ground_map, model_of, plane, straight, tables_with


def driven_along(path: CandidatePath, **options: object) -> Driven:
    model = model_of(tables_with())
    ground = plane(0.05, y=(-20.0, 20.0))
    (plan,) = CandidatePlanner(model).plan(ground, [path])
    return Driven(plan, None, Points(*np.empty((2, 0))))


def later(driven: Driven, i: int) -> Driven:
    """The same drive, with its plan beginning at station i."""
    plan = driven.plan
    names = [n for n in SpeedPlan.__dataclass_fields__ if isinstance(getattr(plan, n), np.ndarray)]
    values = {n: getattr(plan, n) for n in SpeedPlan.__dataclass_fields__}
    values |= {n: values[n][i:] for n in names}
    early = slice(max(i - BEHIND, 0), i)
    limit = None if driven.speed_limit is None else driven.speed_limit[i:]
    return Driven(SpeedPlan(**values), limit, Points(plan.x[early], plan.y[early]))


def test_speed_and_time_between_stations_follow_from_v_squared() -> None:
    driven = driven_along(straight(20.0))
    plan = driven.plan
    for share in (0.0, 0.3, 0.99):
        x = plan.x[7] + share * (plan.x[8] - plan.x[7])
        place = driven.locate((x, 0.0), 0.0)
        v = np.sqrt((1.0 - share) * plan.speed[7] ** 2 + share * plan.speed[8] ** 2)
        assert driven.speed_at(place)[0] == pytest.approx(v)
        way = share * (plan.station[8] - plan.station[7])
        assert driven.station_at(place) == pytest.approx(plan.station[7] + way)
        expected = plan.time[7] + way / (0.5 * (v + plan.speed[7]))
        assert driven.time_at(place) == pytest.approx(expected)


def test_the_rest_holds_two_stations_behind_and_so_the_same_ground() -> None:
    """Grade, roll and curvature of the stations ahead are the same numbers as before."""
    ground = ground_map(lambda x, y: 0.4 * np.sin(x) * np.cos(0.7 * y), y=(-20.0, 20.0))
    path = batch([arc(20.0, 0.15)], 0.25)
    model = model_of(tables_with())
    size = model.vehicle.wheelbase, model.vehicle.track_width
    whole = terrain_profile(ground, path.x, path.y, path.count, *size)
    (plan,) = CandidatePlanner(model).plan(ground, [arc(20.0, 0.15)])
    driven = Driven(plan, None, Points(*np.empty((2, 0))))
    for i in (0, 1, 2, 3, 30):
        own = later(driven, i)
        for _ in range(2):  # and once more, with nothing driven in between
            place = own.locate((float(own.plan.x[0]), float(own.plan.y[0])), 0.15 * 0.25 * i)
            rest, first = own.rest(place)
            assert first == min(i, BEHIND)
            again = terrain_profile(ground, rest.x, rest.y, rest.count, *size)
            # With two stations behind, the neighbour of the first one is as it was, too.
            for name in ("grade", "sin_roll", "curvature", "z"):
                before = getattr(whole, name)[i:, 0]
                assert np.array_equal(getattr(again, name)[first:, 0], before)
            if i >= BEHIND:
                assert again.grade[first - 1, 0] == whole.grade[i - 1, 0]
            own = later(own, 0) if first == 0 else own


def test_a_path_goes_on_with_the_stations_beyond_its_end() -> None:
    driven = driven_along(arc(10.0, 0.1))
    longer = batch([arc(16.0, 0.1)], 0.25)
    x, y = longer.x[:, 0], longer.y[:, 0]
    place = driven.locate((float(x[8]), float(y[8])), 0.2)
    path, first = driven.going_on(place, (x[8:], y[8:], None), extended=True)
    steps = np.hypot(np.diff(path.x[:, 0]), np.diff(path.y[:, 0]))
    assert steps == pytest.approx(np.full(len(steps), 0.25), rel=0.02)
    assert (path.x[-1, 0], path.y[-1, 0]) == (x[-1], y[-1])
    assert first == BEHIND
    same, _ = driven.going_on(place, (x[8:], y[8:], None), extended=False)
    assert (same.x[-1, 0], same.y[-1, 0]) == (driven.plan.x[-1], driven.plan.y[-1])


def test_a_full_circle_is_extended_at_its_end_and_not_where_it_passes_its_start() -> None:
    around = 2.0 * np.pi / 0.4
    driven = driven_along(arc(0.9 * around, 0.4))
    twice = batch([arc(1.9 * around, 0.4)], 0.25)
    x, y = twice.x[:, 0], twice.y[:, 0]
    place = driven.locate((0.0, 0.0), 0.0)
    assert driven.agrees(place, x, y, 0.1)
    path, _ = driven.going_on(place, (x, y, None), extended=True)
    length = Points(path.x[:, 0], path.y[:, 0]).arc()[-1]
    assert length == pytest.approx(1.9 * around, rel=0.02)


def test_limits_of_the_offered_path_hold_on_the_driven_stations() -> None:
    driven = driven_along(straight(10.0))
    x = np.arange(2.1, 14.0, 0.25)
    limit = np.where(x > 6.0, 1.0, np.inf)
    place = driven.locate((2.1, 0.0), 0.0)
    path, _ = driven.going_on(place, (x, np.zeros_like(x), limit), extended=True)
    assert path.speed_limit is not None
    own = path.speed_limit[:, 0]
    assert np.all(own[path.x[:, 0] > 5.86] == 1.0)
    assert np.all(np.isinf(own[path.x[:, 0] < 5.8]))


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (arc(12.0, 0.1), True),
        (arc(9.0, 0.1), True),
        (arc(20.0, 0.1), True),
        (arc(12.0, 0.105), False),
        (straight(12.0), False),
    ],
)
def test_the_same_path_is_told_from_another(other: CandidatePath, same: bool) -> None:
    driven = driven_along(arc(12.0, 0.1))
    path = batch([other], 0.2)
    place = driven.locate((0.0, 0.0), 0.0)
    assert driven.agrees(place, path.x[:, 0], path.y[:, 0], 0.1) == same


def test_a_place_is_found_again_exactly_whatever_was_driven() -> None:
    path = batch([arc(20.0, 0.08)], 0.25)
    x, y = path.x[:, 0], path.y[:, 0]
    points, station = Points(x, y), 1.03 * Points(x, y).arc()
    for end in (3.0, 7.77, 15.123):
        far = float(np.interp(end, station, x)), float(np.interp(end, station, y))
        assert reached(points, station, far, end + 0.4) == pytest.approx(end, abs=1e-9)
        rest = Points(x[9:], y[9:])
        found = reached(rest, station[9:] - station[9], far, end - station[9])
        assert found == pytest.approx(end - station[9], abs=1e-9)
    assert reached(points, station, (float(x[-1]), float(y[-1])), station[-1]) == np.inf
    assert reached(points, station, (0.0, 50.0), 90.0) == np.inf
    assert reached(points, station, (-5.0, 0.0), -5.0) == 0.0


def test_a_place_beside_is_no_farther_than_its_foot() -> None:
    """Obstacles seen from a path 10 cm outside of a turn are not farther away on this one."""
    inner = batch([arc(15.0, 0.2)], 0.25)
    x, y = inner.x[:, 0], inner.y[:, 0]
    outer_x, outer_y = 5.1 * np.sin(2.0), 5.0 - 5.1 * np.cos(2.0)
    station = Points(x, y).arc()
    found = reached(Points(x, y), station, (float(outer_x), float(outer_y)), 5.1 * 2.0)
    assert found == pytest.approx(10.0, abs=0.01)


def test_paths_of_a_plan_are_contiguous_batches() -> None:
    driven = driven_along(straight(10.0))
    rest, _ = driven.rest(driven.locate((3.0, 0.0), 0.0))
    assert isinstance(rest, PathBatch)
    assert rest.x.flags.c_contiguous
    assert rest.names == ("straight",)
