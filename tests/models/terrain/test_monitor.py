from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.parameters import Braking, Limits, Model, Terrain
from slopewise.models.stop_logs.drive_quality import SuspectKind
from slopewise.models.terrain.adaptation import AdaptiveClassifier
from slopewise.models.terrain.log_checks import implausible
from slopewise.models.terrain.monitor import (
    Classified,
    GroundChange,
    MonitorSettings,
    TerrainMonitor,
)
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.trace import trace
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.models.terrain import plant
from tests.models.terrain.vehicles import QUIET, estimator_of, samples_of, vehicle_of

HUSKY = read_terrains(find_terrains("husky")).classes
MODEL = Model(
    name="plant",
    vehicle=vehicle_of(),
    braking=Braking(
        m_m=0.0,
        b_m=-0.2,
        m_b=0.0,
        b_b=0.25,
        dead_time=0.4,
        speed_range=(0.2, 1.0),
        grade_range=(-0.26, 0.26),
    ),
    terrain=Terrain(motion_resistance=0.13, lateral_resistance=0.2, slip_track=1.15),
    limits=Limits(speed=1.0, accel=0.5, decel=0.8, jerk=2.0, lateral_accel=1.0, min_load=0.1),
)


def events(log, monitor=None):
    monitor = TerrainMonitor(MODEL, HUSKY, MonitorSettings(QUIET)) if monitor is None else monitor
    estimates = []
    for sample in samples_of(log):
        estimates += monitor.update(sample)
    return estimates + list(monitor.finish()), monitor


@pytest.mark.parametrize(
    ("ground", "name"),
    [(plant.ASPHALT, "asphalt"), (plant.DIRT, "dirt_road"), (plant.SAND, "beach_sand")],
)
def test_the_class_of_a_square(ground, name):
    estimates, _ = events(plant.drive(plant.square(), ground))
    last = [e for e in estimates if isinstance(e, Classified)][-1]
    assert last.answer.name == name
    assert last.answer.probability > 0.8
    assert not [e for e in estimates if isinstance(e, GroundChange)]


@pytest.mark.parametrize("name", ["ASPHALT", "DIRT", "PLOWED", "SAND"])
def test_the_class_with_the_gyroscope_and_the_settings_of_print(name):
    # Slip 2.1: a yaw rate with noise of 0.3 rad/s
    log = plant.drive(plant.square(), getattr(plant, name), gyro_std=0.3)
    estimates, _ = events(log, TerrainMonitor(MODEL, HUSKY))
    complete = [e for e in estimates if np.isfinite(e.observation.known.values).all()]
    expected = {"DIRT": "dirt_road", "PLOWED": "plowed_terrain", "SAND": "beach_sand"}
    assert {e.answer.name for e in complete} == {expected.get(name, "asphalt")}


@pytest.mark.parametrize("dt", [0.1, 0.05, 0.02])
def test_slow_logs_have_the_same_result(dt):
    estimates, _ = events(plant.drive(plant.square(turn=4.0), plant.DIRT, dt=dt))
    assert estimates[-1].answer.name == "dirt_road"
    assert estimates[-1].observation.known.values == pytest.approx((0.13, 0.20, 1.15), abs=0.1)
    assert not [e for e in estimates if isinstance(e, GroundChange)]


def test_a_change_is_noticed_and_what_was_known_forgotten():
    legs = plant.square(sides=8)
    when = 2.0 + 4 * 10.6 + 1.0

    def ground(s):
        return plant.ASPHALT if s < when else plant.SAND

    estimates, _ = events(plant.drive(legs, ground))
    changes = [e for e in estimates if isinstance(e, GroundChange)]
    assert len(changes) == 1
    assert 0.0 < changes[0].time - when < 6.0
    at = estimates.index(changes[0])
    after = next(e for e in estimates[at + 1 :] if isinstance(e, Classified))
    assert np.isnan(after.observation.known.values[1])  # not yet turned on the new ground
    assert estimates[-1].answer.name == "beach_sand"


def test_stuck_has_no_class():
    estimates, _ = events(plant.drive([(2, 0, 0), (8, 0.5, 0.0), (6, 0.0, np.nan)], plant.DIRT))
    stuck = [
        e for e in estimates if isinstance(e, Classified) and e.observation.phase is Phase.STUCK
    ]
    assert stuck
    assert all(e.answer.name == "" for e in stuck)


def test_adaptive_classes_are_trained_while_driving():
    adaptive = AdaptiveClassifier(HUSKY)
    monitor = TerrainMonitor(MODEL, HUSKY, MonitorSettings(QUIET), adaptive=adaptive)
    events(plant.drive(plant.square(sides=6), plant.ASPHALT), monitor)
    assert adaptive.classes.terrain[0].lateral_resistance.samples > 6.0


def log_of(**changes):
    log = plant.drive(plant.square(sides=2), plant.DIRT)
    return {**log, **{name: change(log[name].copy()) for name, change in changes.items()}}


def found_in(log):
    return implausible(log, (slice(0, len(log["t"])),), vehicle_of())


def test_logs_of_this_vehicle_are_plausible():
    assert found_in(log_of()) == []


@pytest.mark.parametrize(
    ("changes", "channel", "kind", "message"),
    [
        (
            {"v_left": lambda v: v / 0.13, "v_right": lambda v: v / 0.13},
            "v_left",
            SuspectKind.UNITS,
            "rad/s",
        ),
        ({"yaw_rate": np.rad2deg}, "yaw_rate", SuspectKind.UNITS, "degrees per second"),
        ({"current_left": lambda i: 1000.0 * i}, "current_left", SuspectKind.SENTINEL, "thrust of"),
        ({"current_left": np.negative}, "current_left", SuspectKind.UNITS, "positive currents"),
        ({"yaw_rate": np.negative}, "yaw_rate", SuspectKind.UNITS, "turns against the wheels"),
    ],
)
def test_wrong_units(changes, channel, kind, message):
    estimates = found_in(log_of(**changes))
    assert {(s.channel, s.kind) for s in estimates} == {(channel, kind)}
    assert message in estimates[0].reason


def test_motors_that_hold_back_downhill_have_the_right_sign():
    log = plant.drive(plant.square(sides=2), plant.DIRT, pitch=0.4)
    assert np.median(log["current_left"][400:800]) < -0.5
    assert found_in(log) == []


def test_a_sentinel_marks_its_own_samples():
    def sentinel(current):
        current[400:420] = -1000.0
        return current

    (estimates,) = found_in(log_of(current_right=sentinel))
    assert (estimates.start, estimates.stop, estimates.channel) == (400, 420, "current_right")


def test_the_trace_of_a_run_settles_where_riccati_says():
    log = plant.drive(plant.square(turn=4.0), plant.DIRT)
    rows = [(sample, True, ()) for sample in samples_of(log)]
    trace_rows = trace(estimator_of(), rows, QUIET.filter)
    assert len(trace_rows.time) == len(log["t"])
    assert trace_rows.predicted_variance[0] == pytest.approx(0.3**2 + 1e-4)
    assert trace_rows.predicted_variance[100:].min() == pytest.approx(
        trace_rows.settled_variance, rel=0.05
    )
    assert trace_rows.active.sum() > 1000
    assert np.isnan(trace_rows.slip_track[:200]).all()
    standing = plant.drive([(3, 0, 0)], plant.DIRT)
    rows = [(sample, True, ()) for sample in samples_of(standing)]
    trace_rows = trace(estimator_of(), rows, QUIET.filter)
    assert not trace_rows.active.any()
    assert np.isnan(trace_rows.settled_variance)
