"""The verifier against the slow reference of stops, and with violations planted one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, time_optimal_batch
from slopewise.planner.verify.terms import terms_of
from slopewise.planner.verify.verifier import Track, Verification, check, track_of
from tests.world.formulas import DECELERATION, SAMPLES
from tests.world.ground import arc, ground_map, hills, plane, straight
from tests.world.plans import min_loads, plan_one, stop_on
from tests.world.vehicles import Tables, model_of, tables_with


class Case:
    """One candidate with its time-optimal profile, ready to be verified."""

    def __init__(
        self,
        tables: Tables,
        elevation_map: ElevationMap,
        path: CandidatePath,
        *,
        spacing: float = 0.25,
        **options: Any,
    ) -> None:
        self.tables, self.model = tables, model_of(tables)
        part = batch([path], spacing)
        self.solved: TimeOptimalBatch = time_optimal_batch(
            elevation_map, part, self.model, **options
        )
        self.track: Track = track_of(self.solved.profile, self.solved.ground, 0, part.speed_limit)
        self.speed_sq = self.solved.speed_sq[:, 0].copy()

    def verify(self, speed_sq: np.ndarray | None = None, **options: Any) -> Verification:
        bounds, ground = self.solved.bounds, self.solved.ground
        return check(
            self.track,
            self.speed_sq if speed_sq is None else speed_sq,
            options.pop("clear", float(bounds.clear_distance[0])),
            float(ground.distance_offset[0]),
            terms_of(self.model, ground.motion, ground.errors)._replace(**options),
            track_of(self.solved.profile, bounds.even_ground, 0),
        )

    def kinds(self, speed_sq: np.ndarray, **options: Any) -> dict[str, float]:
        """Violations and their amounts."""
        violation = self.verify(np.ascontiguousarray(speed_sq), **options).violation
        return {name: value for name, value in violation._asdict().items() if value > 0.0}


MOTIONS = {name: SAMPLES[name] for name in (*DECELERATION, "brake_lag", "brake_fade")}
# Where brakes are as strong as friction, plans count stops a centimetre long.
MOTIONS["wheel_lockup"] = {"mu": 0.35}
CREST_ERROR = 0.1
"""Share by which a reported load may be below that of the ground between stations."""


@pytest.mark.parametrize("name", ["", *MOTIONS])
@pytest.mark.parametrize("curvature", [0.0, 0.15])
def test_stops_agree_with_the_slow_reference_within_a_millimetre(
    name: str, curvature: float
) -> None:
    tables = tables_with(*([(name, MOTIONS[name])] if name else []))
    path = arc(14.0, curvature) if curvature else straight(14.0)
    plan = plan_one(tables, ground_map(hills, resolution=0.1), path)
    going = np.flatnonzero(plan.speed > 0.0)
    for k in going[:: max(len(going) // 6, 1)]:
        stop = stop_on(plan, tables, plan.station[k], plan.speed[k])
        assert plan.stop_distance[k] == pytest.approx(stop.distance + 0.2, abs=1e-3)
        rear, side = min_loads(plan, tables, stop)
        # Between stations a plan takes the sharper crest of those on both sides.
        assert side - CREST_ERROR <= plan.side_load[k] <= side + 2e-3
        assert plan.rear_load[k] <= rear + 2e-3
        if name in ("", "wheel_lockup"):
            assert plan.rear_load[k] >= rear - CREST_ERROR


def stop_at(case: Case, time_step: float) -> np.ndarray:
    return case.verify(time_step=time_step, between=0).stop_distance


def test_the_integrator_converges_and_its_step_is_fine_enough() -> None:
    """Smooth ground and a motion term: the error falls at least with the cube of the step."""
    tables = tables_with(
        ("aerodynamic_drag", {"c": 0.1}),
        ("viscous_resistance", {"c": 0.05}),
        braking={"dead_time": 0.0},
    )
    case = Case(tables, plane(rise=-0.1), straight(20.0))
    exact = stop_at(case, 1e-4)
    error = [np.abs(stop_at(case, h) - exact).max() for h in (0.08, 0.04, 0.02)]
    assert error[2] < 1e-5
    assert error[0] / error[1] > 3.5
    assert error[1] / error[2] > 3.5


def test_what_the_planner_makes_is_innocent() -> None:
    for case in (
        Case(tables_with(), plane(), straight(20.0)),
        Case(tables_with(), ground_map(hills), arc(14.0, 0.1)),
        Case(tables_with(), plane(unknown=lambda x, y: x > 15.0), straight(20.0)),
    ):
        verdict = case.verify()
        assert verdict.valid, verdict.violation
        assert len(verdict.where) == 0
        assert max(verdict.violation) == 0.0


def test_a_stop_that_is_too_long_is_found_where_it_is() -> None:
    case = Case(tables_with(limits={"decel": 9.0}), plane(), straight(20.0))
    assert case.verify().valid
    label = case.solved.bounds.limiting[:, 0] == Limiting.STOPPING_PATH
    close = np.flatnonzero(label & (case.speed_sq > 1.0) & (case.speed_sq < 9.0))
    k = int(close[2])
    speed_sq = case.speed_sq.copy()
    speed_sq[k] *= 1.05
    assert case.kinds(speed_sq)["overrun"] > 0.01
    where = case.verify(speed_sq).where
    assert set(where) <= {k - 1, k}
    assert len(where)
    # And if the path ends earlier, by how much earlier.
    assert case.kinds(case.speed_sq, clear=case.track.station[-1] - 0.5)["overrun"] == (
        pytest.approx(0.5, abs=0.05)
    )


def test_a_breach_between_stations_only_is_found() -> None:
    """Twice as fast from one station on: both ends of the segment alone are fine."""
    limit = np.array([1.0, 3.0, 3.0, 3.0])
    points = np.array([(0.0, 0.0), (6.0, 0.0), (6.2, 0.0), (20.0, 0.0)])
    kappa = 0.6
    tables = tables_with(limits={"lateral_accel": 0.5, "speed": 4.0, "accel": 50.0, "decel": 50.0})
    case = Case(tables, plane(), CandidatePath("p", points, speed_limit=limit))
    curvature = np.zeros_like(case.track.station)
    curvature[10], curvature[11] = kappa, 0.0
    case.track = case.track._replace(curvature=curvature)
    # v² is allowed up to 0.5/κ at station 10 and anything at 11; in between v² κ has a hump.
    speed_sq = np.zeros_like(case.speed_sq)
    speed_sq[:10] = 0.1
    speed_sq[10], speed_sq[11] = 0.5 / kappa, 8.0
    strict = case.verify(speed_sq, between=0).violation
    assert strict.lateral == 0.0
    assert case.verify(speed_sq).violation.lateral > 0.5


def test_lateral_acceleration_is_that_in_the_tilted_plane() -> None:
    """v² κ / cos φ: across a slope the same turn takes more of it."""
    case = Case(tables_with(limits={"lateral_accel": 0.5}), plane(cross=0.25), straight(12.0))
    curvature = -np.sign(case.track.roll) * 0.1
    case.track = case.track._replace(curvature=curvature)
    cos_roll = 1.0 / np.sqrt(1.0 + 0.25**2)
    for share, breached in ((0.99, False), (1.01, True)):
        speed_sq = np.minimum(case.speed_sq, share * 0.5 * cos_roll / 0.1)
        assert ("lateral" in case.kinds(speed_sq)) == breached


def test_the_dead_time_of_a_surface_holds_from_the_segment_in_which_it_starts() -> None:
    tables = tables_with(limits={"speed": 2.0})
    tables["braking"]["terrain"] = {"slick": {"dead_time": 1.5}}
    ground = plane(classes=lambda x, y: x > 8.0, class_names=("", "slick"))
    case = Case(tables, ground, straight(14.0), spacing=1.0)
    dead, station = case.track.dead_time, case.track.station
    k = int(np.flatnonzero(dead == 1.5)[0])
    assert dead[k - 1] == 0.3
    speed_sq = np.where(station < station[k], case.speed_sq, 0.0)
    # A way that is free for a stop with the shorter dead time, from the station before.
    clear = station[k - 1] + case.verify(speed_sq).stop_distance[k - 1] + 0.1
    assert case.kinds(speed_sq, clear=clear).get("overrun", 0.0) == 0.0
    case.track = case.track._replace(dead_time=np.where(station >= station[k - 1], 1.5, 0.3))
    within = case.kinds(speed_sq, clear=clear)["overrun"]
    assert 0.0 < within < 1.5 * np.sqrt(speed_sq[k - 1])


DRIVE = {"max_drive_force": 9000.0, "max_drive_power": 9e4}
LIGHT = {"accel": 4.0, "min_load": 0.25}


@pytest.mark.parametrize(
    ("kind", "strong", "weak", "rise"),
    [
        (
            "accel",
            {"vehicle": {"max_drive_force": 9000.0}, "limits": {"accel": 5.0}},
            {"vehicle": {"max_drive_force": 1000.0}, "limits": {"accel": 5.0}},
            0.05,
        ),
        (
            "accel",
            {"vehicle": {"max_drive_force": 9000.0}, "limits": {"accel": 5.0}},
            {"vehicle": DRIVE | {"max_drive_power": 1500.0}, "limits": {"accel": 5.0}},
            0.05,
        ),
        (
            "axle_load",
            {"vehicle": DRIVE | {"cg_z": 0.3}, "limits": LIGHT},
            {"vehicle": DRIVE | {"cg_z": 0.8, "cg_x": 0.45}, "limits": LIGHT},
            0.1,
        ),
        (
            "decel",
            {"limits": {"decel": 3.0}},
            {"braking": {"sliding_friction": 0.25}, "limits": {"decel": 3.0}},
            -0.15,
        ),
    ],
    ids=["thrust", "power", "front axle lifting", "friction"],
)
def test_the_profile_of_a_stronger_vehicle_is_refused_to_a_weaker_one(
    kind: str, strong: Tables, weak: Tables, rise: float
) -> None:
    more, less = (
        Case(tables_with(**tables), plane(rise=rise), straight(20.0)) for tables in (strong, weak)
    )
    assert more.verify().valid
    assert less.verify().valid
    assert kind in less.kinds(more.speed_sq)


def test_a_stop_commanded_before_a_turn_slides_through_it_where_it_is_too_fast() -> None:
    """The plan itself is slow in the turn, where friction leaves its brakes enough."""
    along = np.linspace(0.0, 8.0, 81)
    yaw = 0.5 * np.maximum(along - 3.0, 0.0)
    steps = 0.1 * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)[:-1]
    path = CandidatePath("turn", np.concatenate([[(0.0, 0.0)], np.cumsum(steps, axis=0)]))
    case = Case(tables_with(braking={"sliding_friction": 0.3}), plane(), path)
    profile = np.where(case.track.station < 2.9, 2.6, 1.2) ** 2
    profile[case.track.station > 6.5] = 0.0
    assert case.kinds(profile)["overrun"] > 1.0
    slow = np.minimum(profile, 1.2**2)
    assert "overrun" not in case.kinds(slow)


def test_standing_plans_have_no_stop_but_loads() -> None:
    case = Case(tables_with(), plane(rise=-0.2, cross=0.1), straight(20.0))
    verdict = case.verify(np.zeros_like(case.speed_sq))
    assert verdict.valid
    np.testing.assert_array_equal(verdict.stop_distance, 0.0)
    grade, roll = case.track.grade[0], case.track.roll[0]
    rear = np.cos(roll) * np.cos(grade) + 0.55 / 0.6 * np.sin(grade)
    side = np.cos(roll) * np.cos(grade) - 1.1 * np.cos(grade) * abs(np.sin(roll))
    np.testing.assert_allclose(verdict.rear_load, rear, rtol=1e-9)
    np.testing.assert_allclose(verdict.side_load, side, rtol=1e-9)


@pytest.mark.parametrize("path", [straight(15.0), arc(15.0, 0.05)], ids=["straight", "turn"])
def test_the_front_wheel_keeps_its_load_under_drive_and_bank(path: CandidatePath) -> None:
    """A light front, uphill on a bank and in a turn, speeding up; loads as free body."""
    vehicle = {"cg_x": 0.38, "cg_z": 0.8, "max_drive_force": 5000.0, "max_drive_power": 9000.0}
    tables = tables_with(vehicle=vehicle)
    ground = plane(0.2, 0.17)
    plan = plan_one(tables, ground, path)
    accel = np.append(0.5 * np.diff(plan.speed**2) / np.diff(plan.station), 0.0)
    turn = plan.curvature * plan.speed**2 / np.cos(plan.roll) / 9.80665
    sideways = 1.6 * np.abs(np.cos(plan.grade) * np.sin(plan.roll) + turn)
    lengthwise = 0.8 / 0.38 * (np.maximum(accel, 0.0) / 9.80665 + np.sin(plan.grade))
    wheel = np.cos(plan.grade) * np.cos(plan.roll) - lengthwise - sideways
    assert plan.speed.max() > 0.5
    assert not plan.reason.startswith("slowed")
    assert wheel[accel > 0.0].min() >= 0.10 - 0.005
