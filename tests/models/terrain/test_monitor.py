"""Monitor of terrain on a log: descriptions, changes, checks; and the slip track filter in it."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from slopewise.models.stop_logs.drive_quality import SuspectKind
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.terrain.classes import FeatureOfClass, TerrainClass, TerrainClasses
from slopewise.models.terrain.description import (
    UNDECIDED,
    GroundChange,
    GroundDescriber,
    GroundDescription,
    ThresholdSettings,
    open_surfaces,
)
from slopewise.models.terrain.log_checks import implausible
from slopewise.models.terrain.monitor import DescribedStretch, TerrainMonitor
from slopewise.models.terrain.settings import FilterSettings
from slopewise.models.terrain.slip_track_filter import SlipTrackFilter, steady_state_variance
from slopewise.models.terrain.surfaces import with_open_surfaces
from slopewise.models.terrain.trace import trace
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.models.terrain import plant
from tests.models.terrain.vehicles import (
    MODEL,
    QUIET,
    estimator_of,
    observation_of,
    samples_of,
    vehicle_of,
)
from tests.planner.scenes import ground_map, straight

# ----------------------------------------------------------------------------- description


HUSKY = read_terrains(find_terrains("husky"))
THRESHOLDS = ThresholdSettings(soft_above=0.15, slippery_below=0.3)
NAN = math.nan


def described(*observations, thresholds=THRESHOLDS):
    describer = GroundDescriber(thresholds)
    changes = [c for o in observations for c in describer.add(o)]
    return describer, changes


def repeated(count, begin=0.0, **features):
    """Stretches of two seconds each."""
    f_r = features.pop("f_r", NAN)
    return [observation_of(f_r, end=begin + 2.0 * (i + 1), **features) for i in range(count)]


@pytest.mark.parametrize(
    ("f_r", "turning", "text"),
    [
        (0.12, NAN, "hard"),
        (0.19, NAN, "soft"),
        (0.15, NAN, UNDECIDED),
        (0.10, 0.2, "hard, slippery"),
        (NAN, 0.4, "gripping"),
    ],
)
def test_what_is_stated(f_r, turning, text):
    describer, _ = described(*repeated(3, f_r=f_r, turning=turning))
    assert str(describer.describe()) == text


def test_the_score_by_hand_and_the_two_levels():
    # ln(0.19/0.15) = 0.2364 over √(0.17² + 0.18²/3) = 0.1994
    describer, _ = described(*repeated(3, f_r=0.19, error=0.18))
    score = describer.describe().hardness_score
    assert score == pytest.approx(0.2364 / 0.1994, abs=1e-3)
    assert describer.describe().hardness == "soft"
    assert describer.describe(relied_on=True).hardness == UNDECIDED
    assert math.isnan(describer.describe().grip_score)
    # twice the speed: 0.20 ln 2 more
    fast = [dataclasses.replace(o, speed=0.6) for o in repeated(3, f_r=0.19, error=0.18)]
    more = described(*fast)[0].describe().hardness_score - score
    assert more == pytest.approx(0.2 * math.log(2.0) / 0.1994, abs=1e-3)


def test_evidence_is_forgotten_after_twelve_seconds():
    describer, _ = described(*repeated(3, f_r=0.3), *repeated(7, 6.0, turning=0.6))
    assert str(describer.describe()) == "gripping"


def test_without_a_threshold_nothing_is_stated():
    describer, _ = described(*repeated(3, f_r=0.9, turning=0.9), thresholds=ThresholdSettings())
    assert str(describer.describe()) == UNDECIDED


def test_a_change_is_a_description_turned_around():
    rows = [*repeated(4, f_r=0.08, turning=0.6), *repeated(4, 8.0, f_r=0.3, turning=0.6)]
    _, changes = described(*rows)
    (change,) = changes
    assert (change.before, change.now, change.again) == ("hard", "soft", False)
    assert 8.0 < change.time <= 14.0
    assert change.strength >= 1.0
    back = [*rows, *repeated(3, 16.0, f_r=0.08, turning=0.6)]
    assert [(c.now, c.again) for c in described(*back)[1]] == [("soft", False), ("hard", True)]
    # to undecided ground is no change, and what was before is remembered
    _, changes = described(*rows[:4], *repeated(4, 8.0, f_r=0.15), *repeated(3, 16.0, f_r=0.3))
    assert [(c.before, c.now) for c in changes] == [("hard", "soft")]


# --------------------------------------------------------- no description makes a plan faster


SURFACES = {
    "asphalt": (0.08, 0.40, 0.42),
    "ice": (0.11, 0.08, 0.12),
    "loam": (0.20, 0.60, 0.30),
    "snow": (0.30, 0.30, 0.20),
}
"""f_r, μ_t and the b_b of a table of braking."""
DESCRIPTIONS = [
    GroundDescription(*texts)
    for texts in itertools.product(("hard", "soft", UNDECIDED), ("gripping", "slippery", UNDECIDED))
]
CLASSES = TerrainClasses(
    name="x",
    terrain=tuple(
        TerrainClass(
            name=name,
            motion_resistance=FeatureOfClass(mean=f_r, std=0.01, samples=6),
            lateral_resistance=FeatureOfClass(mean=mu_t, std=0.01, samples=6),
        )
        for name, (f_r, mu_t, _) in SURFACES.items()
    ),
)
TABLES = {
    **{name: SurfaceBraking(b_b=b_b) for name, (_, _, b_b) in SURFACES.items()},
    "wet": SurfaceBraking(b_b=0.15, state_of="loam"),
}
SURFACED = dataclasses.replace(MODEL, braking=dataclasses.replace(MODEL.braking, terrain=TABLES))


def opened(description):
    names = open_surfaces(CLASSES, THRESHOLDS, SURFACED.vehicle, description)
    return names, with_open_surfaces(SURFACED, names)


def test_surfaces_that_a_description_leaves_open():
    def names(hardness, grip):
        return opened(GroundDescription(hardness, grip))[0]

    assert names("hard", "gripping") == ("asphalt",)
    assert names("hard", UNDECIDED) == ("asphalt", "ice")
    assert names(UNDECIDED, "gripping") == ("asphalt", "loam", "snow")
    assert names("soft", "slippery") == ()
    assert names(UNDECIDED, UNDECIDED) == tuple(SURFACES)


@pytest.mark.parametrize("description", DESCRIPTIONS, ids=str)
@pytest.mark.parametrize("surface", ["", *SURFACES])
def test_no_description_makes_a_plan_faster_on_any_surface(description, surface):
    """Right or wrong: on ground with or without a name a plan with it is nowhere faster."""
    here = ground_map(lambda x, y: 0.0 * x, x=(-2.0, 8.0), y=(-2.0, 2.0), resolution=0.5)
    if surface:
        numbers = np.zeros(here.elevation.shape, np.int64)
        here = dataclasses.replace(here, terrain_class=numbers, class_names=(surface,))
    names, model = opened(description)
    (before,) = CandidatePlanner(SURFACED).plan(here, [straight(6.0)])
    (after,) = CandidatePlanner(model).plan(here, [straight(6.0)])
    assert np.all(after.speed <= before.speed + 1e-9)
    if surface:
        assert np.array_equal(after.speed, before.speed)
    weakest = [model.braking.on(name).b_b for name in ("", *model.braking.states_of(""))]
    assert min(weakest) <= min([SURFACES[name][2] for name in names], default=0.25)
    assert ("loam" not in names) or min(weakest) <= 0.15  # its state counts as well


def test_undecided_is_never_faster_than_any_decision():
    """The weakest of what is open: the less is stated, the weaker."""

    def weakest(description):
        braking = opened(description)[1].braking
        return min(braking.on(name).b_b for name in ("", *braking.states_of("")))

    for hardness, grip in itertools.product(("hard", "soft"), ("gripping", "slippery")):
        exact = weakest(GroundDescription(hardness, grip))
        for vague in (
            GroundDescription(hardness),
            GroundDescription(grip=grip),
            GroundDescription(),
        ):
            assert weakest(vague) <= exact


# --------------------------------------------------------------------------------- monitor


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


def test_stuck_is_not_described():
    estimates, _ = events(plant.drive([(2, 0, 0), (8, 0.5, 0.0), (6, 0.0, np.nan)], plant.DIRT))
    stuck = [e for e in estimates if isinstance(e, DescribedStretch) and e.is_stuck]
    assert stuck
    assert all(str(e.description) == UNDECIDED and not e.agrees_with for e in stuck)
    assert all(e.rules.name == "" for e in stuck)


# ---------------------------------------------------------------------------- vehicle check


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


# ------------------------------------------------------------------------------ log checks


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


# ----------------------------------------------------------------------- slip track filter


PRINT = FilterSettings()


def settled(difference: float, settings: FilterSettings) -> float:
    """Variance after very many samples."""
    observer = SlipTrackFilter(1.0, settings)
    for _ in range(20_000):
        observer.update(difference, 0.8, settings.sample_time)
    return observer.variance


@pytest.mark.parametrize("difference", [0.3, 0.785, 1.2, -1.2, 2.0])
@pytest.mark.parametrize("settings", [PRINT, FilterSettings(yaw_rate_std=0.02, sample_time=0.1)])
def test_variance_settles_at_the_riccati_solution(difference, settings):
    # scipy solves the same equation by another way, for the variance before a sample
    before = solve_discrete_are(
        [[1.0]], [[difference]], [[settings.process_variance]], [[settings.yaw_rate_std**2]]
    )[0, 0]
    ours, after = steady_state_variance(difference, settings)
    assert ours == pytest.approx(before, rel=1e-9)
    assert settled(difference, settings) == pytest.approx(after, rel=1e-9)


def test_print_settles_near_its_figure_at_one_metre_and_twenty():
    # Slip 4.1: 0.0025; by hand H² = Q R/(P² − P Q) = 9e-6/6e-6, H = 1.2247
    assert steady_state_variance(math.sqrt(1.5))[0] == pytest.approx(0.0025, rel=1e-12)
    assert steady_state_variance(1.2)[0] == pytest.approx(0.00255, abs=1e-5)


def steps_to_settle(initial_variance: float, within: float = 0.05) -> int:
    """Samples until the variance before a sample stays within 5 % of where it settles."""
    final, _ = steady_state_variance(1.2)
    observer = SlipTrackFilter(1.0, FilterSettings(initial_std=math.sqrt(initial_variance)))
    last = 0
    for step in range(1, 400):
        before = observer.variance + PRINT.process_variance
        if abs(before / final - 1.0) > within:
            last = step
        observer.update(1.2, 1.0, PRINT.sample_time)
    return last


def test_the_twelfth_step_of_print_needs_a_small_initial_variance():
    # Slip Fig. 8 settles by the 12th step at ΔV of about 1.2 m/s. Its initial variance is not
    # given. Settled means within 5 %: then it began within a tenth of where it settles.
    steps = {p: steps_to_settle(p) for p in (1.0, 0.09, 0.01, 0.004, 0.003, 0.0027, 0.0022)}
    assert steps == {1.0: 47, 0.09: 46, 0.01: 40, 0.004: 29, 0.003: 18, 0.0027: 9, 0.0022: 9}
    assert steps_to_settle(0.003, within=0.1) == 9


@given(st.floats(0.1, 3.0), st.floats(0.3, 2.0), st.floats(1e-4, 1.0), st.floats(0.001, 0.5))
def test_one_sample_is_bayes_rule(difference, slip_track, variance, elapsed):
    # product of two normal densities on a fine grid, by quadrature
    observer = SlipTrackFilter(slip_track, FilterSettings(initial_std=math.sqrt(variance)))
    predicted = variance + 0.01 * elapsed
    width = 8.0 * math.sqrt(predicted) + 2.0 * abs(0.7 / difference - 1.0 / slip_track)
    x = np.linspace(1.0 / slip_track - width, 1.0 / slip_track + width, 200_001)
    prior, likelihood = (x - 1.0 / slip_track) ** 2 / predicted, (0.7 - difference * x) ** 2 / 0.09
    density = np.exp(-0.5 * (prior + likelihood - np.min(prior + likelihood)))
    density /= np.trapezoid(density, x)
    mean = np.trapezoid(x * density, x)
    observer.update(difference, 0.7, elapsed)
    assert observer.inverse == pytest.approx(mean, abs=2e-3 * math.sqrt(predicted))
    spread = np.trapezoid((x - mean) ** 2 * density, x)
    assert observer.variance == pytest.approx(spread, rel=2e-2)


def test_half_the_rate_grows_as_much():
    fast, slow = SlipTrackFilter(1.0), SlipTrackFilter(1.0)
    for _ in range(100):
        fast.update(0.0, 0.0, 0.01)
    slow.update(0.0, 0.0, 1.0)
    assert fast.variance == pytest.approx(slow.variance, rel=1e-12)


def test_a_step_of_the_slip_track_is_followed_within_two_turns():
    # 90° turns at 45 deg/s with print's noise: 2 s each. From asphalt onto sand.
    random = np.random.default_rng(1)
    observer = SlipTrackFilter(1.0)
    for _ in range(4 * 200):
        observer.update(np.pi / 4 * 1.0, np.pi / 4 + random.normal(0, 0.3), 0.01)
    assert observer.slip_track == pytest.approx(1.0, abs=3.0 * observer.slip_track_std)
    after = []
    for _ in range(20):
        again = SlipTrackFilter(1.0)
        again.inverse, again.variance = observer.inverse, observer.variance
        for _ in range(2 * 200):
            again.update(np.pi / 4 * 1.62, np.pi / 4 + random.normal(0, 0.3), 0.01)
        after.append(again.slip_track)
    assert np.mean(after) == pytest.approx(1.62, abs=0.05)
    assert np.std(after) < 0.25


def test_the_spread_it_claims_is_the_spread_it_has():
    # the truth walks at random, as the model of Slip (5) says: normalised errors have variance 1
    random = np.random.default_rng(2)
    errors = []
    for _ in range(300):
        x = 1.0 + 0.3 * random.normal()
        observer = SlipTrackFilter(1.0)
        for _ in range(60):
            x += 0.01 * random.normal()
            observer.update(1.2, 1.2 * x + random.normal(0.0, 0.3), 0.01)
        errors.append((observer.inverse - x) / math.sqrt(observer.variance))
    assert np.var(errors) == pytest.approx(1.0, abs=0.25)


def test_no_turning_is_an_infinite_slip_track():
    observer = SlipTrackFilter(1.0)
    for _ in range(2000):
        observer.update(1.2, -0.1, 0.01)
    assert observer.slip_track == math.inf
    assert observer.slip_track_std == math.inf
