"""Between stations the grade may be steeper than at them: held against the line itself."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.ground.grade_between import grade_between
from slopewise.planner.plan import Status
from slopewise.planner.settings import PlannerSettings
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.io.plan_file import driven
from tests.planner.scenes import SMALL, Tables, model_of, plan_one, tables_with

slopes = st.floats(-0.5, 0.5)


@given(st.floats(0.05, 5.95), slopes, slopes, st.floats(-0.3, 0.3))
def test_one_kink_is_found_wherever_it_is(
    kink: float, before: float, after: float, at: float
) -> None:
    stations = np.arange(8.0)

    def grade(s: np.ndarray) -> np.ndarray:
        return at + np.where(s < kink, before * (s - kink), after * (s - kink))

    lowest, highest = grade_between(grade(stations)[:, None])
    for k in range(1, 7):
        around = grade(np.linspace(k - 1, k + 1, 2001))
        inner = 2 <= k <= 5 or not (k - 1 < kink < k + 1)
        if inner:
            assert lowest[k, 0] <= around.min() + 2e-3 * abs(after - before)
            assert highest[k, 0] >= around.max() - 2e-3 * abs(after - before)
        assert lowest[k, 0] <= min(grade(stations)[k - 1 : k + 2])
        assert highest[k, 0] >= max(grade(stations)[k - 1 : k + 2])


@given(slopes, slopes)
def test_an_even_change_of_grade_stays_within_its_stations(start: float, rise: float) -> None:
    grade = start + rise * np.arange(6.0)
    lowest, highest = grade_between(grade[:, None])
    np.testing.assert_allclose(lowest[1:-1, 0], np.minimum(grade[:-2], grade[2:]), atol=1e-12)
    np.testing.assert_allclose(highest[1:-1, 0], np.maximum(grade[:-2], grade[2:]), atol=1e-12)


def top_heavy() -> Tables:
    """A small vehicle that hardly stands its own brakes, trained up to 7.4° uphill."""
    tables = tables_with()
    for table, values in SMALL.items():
        tables[table].update(values)
    tables["vehicle"] |= {"cg_z": 0.3515, "drive": "ackermann", "max_drive_force": 560.0}
    tables["braking"] |= {
        "m_m": 0.0,
        "b_m": 0.0,
        "m_b": 0.0,
        "b_b": 0.7457,
        "level": 0.6727,
        "dead_time": 0.0,
        "distance_offset": 0.1324,
        "speed_range": [0.24, 1.17],
        "grade_range": [-0.33, 0.129],
        "extrapolate": True,
        "extrapolation_margin": 0.083,
    }
    tables["terrain"] |= {"motion_resistance": 0.08, "lateral_resistance": 0.19, "slip_track": 0.7}
    tables["limits"] |= {
        "speed": 2.0,
        "accel": 2.72,
        "decel": 1.0,
        "lateral_accel": 0.72,
        "min_load": 0.0839,
    }
    return tables


def dip() -> ElevationMap:
    """A hillside with a dip: wheels 0.5 m apart stand on 5.2°, 10.1° and 6.5° within 0.25 m."""
    along = np.array(
        [
            1.598,
            1.524,
            1.398,
            1.276,
            1.206,
            1.123,
            0.99,
            0.879,
            0.813,
            0.719,
            0.584,
            0.484,
            0.419,
            0.313,
            0.179,
            0.09,
            0.023,
            -0.094,
            -0.224,
            -0.302,
            -0.376,
            -0.502,
            -0.624,
            -0.694,
            -0.777,
            -0.91,
            -1.021,
            -0.93,
            -0.969,
            -1.049,
            -1.093,
            -1.103,
            -1.153,
            -1.279,
            -1.367,
            -1.435,
            -1.552,
            -1.681,
            -1.759,
            -1.833,
            -1.959,
            -2.081,
            -2.151,
            -2.235,
            -2.367,
            -2.478,
            -2.544,
        ]
    )
    across = 0.0377 * (np.arange(45.0) - 22.0)
    return ElevationMap(elevation=across[:, None] + along, resolution=0.5, origin=(-8.0, -11.0))


def test_a_kink_beyond_the_trained_range_counts_between_stations() -> None:
    """Brakes that may be stronger there leave less load than the stations alone would show."""
    path = CandidatePath(name="dip", points=np.array([[0.0, 0.0], [10.765, 0.0]]))
    tables = top_heavy()
    plan = plan_one(tables, dip(), path, PlannerSettings(spacing=0.25), start_speed=0.0)
    assert plan.grade[18:25].max() < tables["braking"]["grade_range"][1]
    assert plan.status is Status.BLOCKED
    assert "a wheel keeps" in plan.reason
    assert not check_plan_on_map(plan_of_columns(driven(plan)), model_of(tables), dip()).violations
