"""Monitor of terrain on a log, and checks of log and vehicle file."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from slopewise.models.stop_logs.drive_quality import SuspectKind
from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.description import UNDECIDED, GroundChange
from slopewise.models.terrain.log_checks import implausible
from slopewise.models.terrain.monitor import DescribedStretch, TerrainMonitor
from slopewise.models.terrain.trace import trace
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.models.terrain import plant
from tests.models.terrain.vehicles import MODEL, QUIET, estimator_of, samples_of, vehicle_of

HUSKY = read_terrains(find_terrains("husky"))


def events(log, monitor=None):
    if monitor is None:
        monitor = TerrainMonitor(MODEL, HUSKY.classes, HUSKY.thresholds, QUIET)
    estimates = []
    for sample in samples_of(log):
        estimates += monitor.update(sample)
    return estimates + list(monitor.finish()), monitor


@pytest.mark.parametrize("settings", [QUIET, None], ids=["quiet", "as printed"])
@pytest.mark.parametrize(
    ("ground", "name", "hardness"),
    [
        (plant.ASPHALT, "asphalt", "hard"),
        (plant.PLOWED, "plowed_terrain", "soft"),
        (plant.SAND, "beach_sand", "soft"),
    ],
)
def test_a_square_agrees_with_its_class_and_has_no_name(ground, name, hardness, settings):
    # Slip 2.1: a yaw rate with noise of 0.3 rad/s
    log = plant.drive(plant.square(), ground, gyro_std=0.3 if settings is None else 0.02)
    monitor = TerrainMonitor(MODEL, HUSKY.classes, HUSKY.thresholds, settings)
    estimates, _ = events(log, monitor)
    last = [e for e in estimates if isinstance(e, DescribedStretch)][-1]
    assert name in last.agrees_with
    assert last.description.hardness == hardness
    assert last.name == ""
    assert not [e for e in estimates if isinstance(e, GroundChange)]


def test_classes_of_three_days_give_a_name():
    distinct = [t for t in HUSKY.terrain if t.name != "dirt_road"]  # which agrees as well
    terrain = tuple(dataclasses.replace(t, days=3.0) for t in distinct)
    classes = TerrainClasses(name="husky", terrain=terrain)
    monitor = TerrainMonitor(MODEL, classes, HUSKY.thresholds, QUIET)
    estimates, _ = events(plant.drive(plant.square(), plant.ASPHALT), monitor)
    assert estimates[-1].agrees_with == ("asphalt",)
    assert estimates[-1].name == "asphalt"
    assert estimates[0].name == ""  # straight only


@pytest.mark.parametrize("dt", [0.1, 0.05, 0.02])
def test_slow_logs_have_the_same_result(dt):
    estimates, _ = events(plant.drive(plant.square(turn=4.0), plant.DIRT, dt=dt))
    assert "dirt_road" in estimates[-1].agrees_with
    assert estimates[-1].observation.known.values == pytest.approx((0.13, 0.20, 1.15), abs=0.1)
    assert not [e for e in estimates if isinstance(e, GroundChange)]


def test_after_a_change_what_was_known_is_forgotten():
    when = 2.0 + 4 * 10.6 + 1.0

    def ground(s):
        return plant.ASPHALT if s < when else plant.SAND

    estimates, _ = events(plant.drive(plant.square(sides=8), ground))
    (change,) = [e for e in estimates if isinstance(e, GroundChange)]
    assert (change.before, change.now) == ("hard", "soft")
    assert 0.0 < change.time - when < 8.0
    after = estimates[estimates.index(change) + 1]
    assert np.isnan(after.observation.known.values[1])  # not yet turned on the new ground
    assert estimates[-1].description.hardness == "soft"
    assert "asphalt" not in estimates[-1].agrees_with


def test_a_description_lasts_at_rest_and_expires_while_nothing_steady_is_driven():
    log = plant.drive([(2, 0, 0), (8, 0.5, 0.0), (30, 0.0, 0.0), (1, 0.5, 0.0)], plant.SAND)
    monitor = TerrainMonitor(MODEL, HUSKY.classes, HUSKY.thresholds, QUIET)
    texts = []
    for sample in samples_of(log):
        monitor.update(sample)
        texts.append(str(monitor.describer.describe()))
    assert texts[1200] == texts[3900] == "soft"
    assert texts[-1] == UNDECIDED  # thirty seconds old once it drives on
    assert monitor.open_surfaces() == tuple(t.name for t in HUSKY.terrain)


def test_stuck_is_not_described():
    estimates, _ = events(plant.drive([(2, 0, 0), (8, 0.5, 0.0), (6, 0.0, np.nan)], plant.DIRT))
    stuck = [e for e in estimates if isinstance(e, DescribedStretch) and e.is_stuck]
    assert stuck
    assert all(str(e.description) == UNDECIDED and not e.agrees_with for e in stuck)
    assert all(e.rules == "" for e in stuck)


def message_of(ground, pitches=(0.0,), **changes):
    """Message on drives over slopes, with a vehicle file that is wrong by some keys."""
    vehicle = dataclasses.replace(vehicle_of(), **changes)
    model = dataclasses.replace(MODEL, vehicle=vehicle)
    monitor = TerrainMonitor(model, HUSKY.classes, HUSKY.thresholds, QUIET)
    for pitch in pitches:
        monitor.begin_run()
        events(plant.drive(plant.square(sides=3), ground, pitch=pitch), monitor)
    return monitor.vehicle_check.message()


SLOPES = (-0.15, -0.07, 0.0, 0.07, 0.12)


@pytest.mark.parametrize("ground", [plant.ASPHALT, plant.DIRT, plant.SAND])
@pytest.mark.parametrize("pitches", [(0.0, 0.0), SLOPES])
def test_a_right_vehicle_file_is_not_questioned(ground, pitches):
    assert message_of(ground, pitches) == ""


@pytest.mark.parametrize(
    ("changes", "pitches", "fact"),
    [
        ({"mass": 6.0}, (0.0, 0.0), "at most 1.2"),
        ({"motor_torque_constant": 0.2}, (0.0, 0.0), "at most 1.2"),
        ({"mass": 400.0}, (0.0, 0.0), "at least"),
        ({"mass": 12.0}, SLOPES, "on slopes the thrust changes by 2.5"),
        ({"mass": 75.0}, SLOPES, "on slopes the thrust changes by 0.4"),
        ({"motor_torque_constant": 0.1}, SLOPES, "on slopes the thrust changes by 2.3"),
        ({"wheel_radius": 0.3}, SLOPES, "on slopes the thrust changes by 0.43"),
    ],
)
def test_a_vehicle_file_that_cannot_be_right_is_reported(changes, pitches, fact):
    message = message_of(plant.DIRT, pitches, **changes)
    assert "the vehicle file cannot be right" in message
    assert fact in message
    assert "motor_torque_constant" in message


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
        ({"v": lambda v: v / 3.6}, "v_left", SuspectKind.UNITS, "3.60 times v, as km/h would be"),
        ({"current_right": np.zeros_like}, "current_right", SuspectKind.UNITS, "0 A throughout"),
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
    rows = [(sample, True) for sample in samples_of(log)]
    trace_rows = trace(estimator_of(), rows, QUIET.filter)
    assert len(trace_rows.time) == len(log["t"])
    assert trace_rows.predicted_variance[0] == pytest.approx(0.3**2 + 1e-4)
    assert trace_rows.predicted_variance[100:].min() == pytest.approx(
        trace_rows.settled_variance, rel=0.05
    )
    assert trace_rows.active.sum() > 1000
    assert np.isnan(trace_rows.slip_track[:200]).all()
    standing = plant.drive([(3, 0, 0)], plant.DIRT)
    rows = [(sample, True) for sample in samples_of(standing)]
    trace_rows = trace(estimator_of(), rows, QUIET.filter)
    assert not trace_rows.active.any()
    assert np.isnan(trace_rows.settled_variance)
