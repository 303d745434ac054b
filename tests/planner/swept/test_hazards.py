"""Every hazard in a scene that it bars, and in one with a little less in which it must not.

Rough ground slows, swells do not; on a sine the quarter car has a closed form.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.limiting import Limiting
from slopewise.planner.swept.hazards import swept_hazards
from slopewise.planner.swept.sentences import notes
from tests.world.ground import Height, arc, straight
from tests.world.hazards import MODELS, ground, met
from tests.world.vehicles import model_of, tables_with

STEP, CLEARANCE, BODY = int(Limiting.STEP), int(Limiting.CLEARANCE), int(Limiting.BODY)
UNKNOWN = int(Limiting.UNKNOWN_TERRAIN)
LIMIT = 0.28 / 3.0
CLEAR = 0.75 * 0.28


def box(
    x: tuple[float, float], y: tuple[float, float], height: float, slope: float = 0.0
) -> Height:
    """Something upright on a slope."""
    return lambda east, north: (
        slope * east
        + height * ((east >= x[0]) & (east <= x[1]) & (north >= y[0]) & (north <= y[1]))
    )


EVERYWHERE = (-9.0, 9.0)

CASES = {
    "rock of 3 m between the tracks": (box((9.0, 9.3), (-0.15, 0.15), 3.0), {CLEARANCE, BODY}),
    "rock under one wheel": (box((9.0, 9.3), (0.4, 0.6), 0.8), {STEP, BODY}),
    "low rock under one wheel": (box((9.0, 9.3), (0.4, 0.6), 1.3 * LIMIT), {STEP}),
    "step of 0.4 m up": (box((9.0, 90.0), EVERYWHERE, 0.4), {STEP, BODY}),
    "step up": (box((9.0, 90.0), EVERYWHERE, 1.2 * LIMIT), {STEP}),
    "step down": (box((9.0, 90.0), EVERYWHERE, -1.2 * LIMIT), {STEP}),
    "cliff": (box((9.0, 90.0), EVERYWHERE, -3.0), {STEP}),
    "ditch": (box((9.0, 9.6), EVERYWHERE, -0.5), {STEP}),
    "hole under one wheel": (box((9.0, 9.6), (0.2, 0.8), -0.5), {STEP}),
    "log": (box((9.0, 9.2), EVERYWHERE, 1.3 * LIMIT), {STEP}),
    "wall beside the path": (box((9.0, 12.0), (0.56, 0.9), 1.0), {BODY, STEP}),
    "post next to a wheel": (box((9.0, 9.1), (0.55, 0.65), 1.0), {BODY, STEP}),
    "rock between the wheels": (box((9.0, 9.3), (-0.15, 0.15), 1.15 * CLEAR), {CLEARANCE, BODY}),
}

FREE = {
    "rock between the tracks": box((9.0, 9.3), (-0.15, 0.15), 0.8 * CLEAR),
    "step up": box((9.0, 90.0), EVERYWHERE, 0.8 * LIMIT),
    "step down": box((9.0, 90.0), EVERYWHERE, -0.8 * LIMIT),
    "log": box((9.0, 9.2), EVERYWHERE, 0.8 * LIMIT),
    "low rock under one wheel": box((9.0, 9.3), (0.4, 0.6), 0.8 * LIMIT),
    "gap that a wheel bridges": box((9.0, 9.1), EVERYWHERE, -0.5),
    "rock next to the body": box((9.0, 9.5), (0.85, 2.0), 3.0),
    "swell": lambda x, y: 0.15 * np.sin(2.0 * np.pi * x / 8.0),
    "slope": lambda x, y: np.tan(np.deg2rad(25.0)) * x,
    "side slope": lambda x, y: np.tan(np.deg2rad(14.0)) * y,
    "grade break": lambda x, y: np.tan(np.deg2rad(12.0)) * np.abs(x - 9.0),
    "crest": lambda x, y: -np.tan(np.deg2rad(8.0)) * np.abs(x - 9.0),
}


@pytest.mark.parametrize("slope", [0.0, 0.2, -0.2])
@pytest.mark.parametrize("name", CASES)
def test_it_blocks(name: str, slope: float) -> None:
    height, codes = CASES[name]
    hazards = met(ground(lambda x, y: height(x, y) + slope * x), straight(20.0))
    assert hazards.bar in codes, (hazards.bar, hazards.hazards.searched)
    # It stops before: nothing of the vehicle is at the obstacle yet.
    assert hazards.profile.x[hazards.station - 1, 0] + 0.6 <= 9.0
    assert re.search(
        r"\d\.\d\d m .*at x \S+ m, y \S+ m, .*(limit|clearance|travel)", hazards.reason
    )


@pytest.mark.parametrize("heading", [0.0, 0.5])
@pytest.mark.parametrize("name", FREE)
def test_it_does_not_bar(name: str, heading: float) -> None:
    c, s = np.cos(heading), np.sin(heading)
    turned = ground(
        lambda x, y: FREE[name](c * x + s * y, c * y - s * x), x=(-5.0, 25.0), y=(-5.0, 15.0)
    )
    hazards = met(turned, straight(16.0, heading))
    assert hazards.bar == 0, hazards.reason


def test_a_wheel_in_the_air_is_blocked() -> None:
    """Moguls across the diagonal: no step anywhere, but one wheel hangs."""

    def moguls(height: float) -> Height:
        def wave(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            near = np.exp(-(((x - 9.0) / 2.0) ** 2))
            return near * height * np.sin(np.pi * (x - 9.0) / 1.2) * np.sin(np.pi * y)

        return wave

    hazards = met(ground(moguls(0.06)), straight(20.0))
    assert (hazards.bar, "hangs" in hazards.reason) == (STEP, True)
    assert met(ground(moguls(0.01)), straight(20.0)).bar == 0
    long_legs = tables_with(vehicle={"wheel_travel": 0.5, "max_step": 0.2})
    assert met(ground(moguls(0.06)), straight(20.0), long_legs).bar == 0


def test_breakover_approach_and_departure() -> None:
    """A crest with flanks of 27° touches the underside, a valley the overhangs."""
    crest = ground(lambda x, y: -0.5 * np.abs(x - 9.0))
    assert met(crest, straight(20.0)).bar in (CLEARANCE, STEP)
    valley = ground(lambda x, y: 0.5 * np.abs(x - 9.0))
    long_nose = tables_with(vehicle={"front_overhang": 0.9})
    hazards = met(valley, straight(20.0), long_nose)
    assert (hazards.bar, "front overhang" in hazards.reason) == (BODY, True)
    long_tail = tables_with(vehicle={"rear_overhang": 0.9, "front_overhang": 0.0})
    hazards = met(valley, straight(20.0), long_tail)
    assert (hazards.bar, "rear overhang" in hazards.reason) == (BODY, True)
    high = tables_with(vehicle={"ground_clearance": 1.1, "front_overhang": 0.9, "max_step": 0.2})
    assert met(valley, straight(20.0), high).bar == 0


def test_the_inner_wheels_of_a_turn_meet_what_the_outer_ones_pass() -> None:
    curve = arc(12.0, 0.25)
    middle = met(ground(lambda x, y: 0.0 * x), curve).profile
    k = 40
    left = np.array([-middle.heading_y[k, 0], middle.heading_x[k, 0]])
    for side in (0.5, -0.5):
        at = np.array([middle.x[k, 0], middle.y[k, 0]]) + side * left
        post = ground(
            lambda x, y, at=at: 0.6 * (np.hypot(x - at[0], y - at[1]) < 0.08),
            x=(-3.0, 12.0),
            y=(-3.0, 12.0),
        )
        assert met(post, curve).bar in (STEP, BODY)


def test_a_coarse_map_says_what_it_cannot_see() -> None:
    """On cells of 1 m a step is a slope, noise a twist: steps are not searched, as reported."""
    rough = np.random.default_rng(3).normal(0.0, 0.05, (17, 29))
    noisy = ground(lambda x, y: rough, 1.0, y=(-8.0, 8.0))
    assert met(noisy, straight(20.0)).bar == 0
    coarse = ground(box((9.0, 90.0), EVERYWHERE, 0.15), 1.0, y=(-8.0, 8.0))
    hazards = met(coarse, straight(20.0))
    assert hazards.bar == 0
    assert np.min(hazards.slowest) > 2.0  # its kinks of 8.5° are all that it shows
    vehicle = MODELS[0].vehicle
    assert "cells of 1 m do not show steps" in notes(vehicle, coarse)[0]
    fine = ground(box((9.0, 90.0), EVERYWHERE, 0.05))
    assert not any("cells of" in note for note in notes(vehicle, fine))
    # A wall larger than a cell is a hazard.
    wall = ground(box((9.0, 10.0), (-1.0, 1.0), 3.0), 1.0, y=(-8.0, 8.0))
    assert met(wall, straight(20.0)).bar in (CLEARANCE, BODY)


def wave(height: float, length: float) -> Height:
    return lambda x, y: height * np.sin(2.0 * np.pi * x / length)


def quarter_car(speed: float, height: float, length: float, hertz: float, damping: float) -> float:
    """Amplitude of the body's acceleration: Gillespie (1992), Ch. 5, the absolute transmissibility
    of a damped oscillator times the input's acceleration."""
    w, w0 = 2.0 * np.pi * speed / length, 2.0 * np.pi * hertz
    r = w / w0
    passed = (1.0 + (2 * damping * r) ** 2) / ((1 - r**2) ** 2 + (2 * damping * r) ** 2)
    return float(height * w**2 * np.sqrt(passed))


def allowed(limit: float, top: float, *wave: float) -> float:
    """The lowest speed whose amplitude is beyond the limit."""
    speeds = np.linspace(0.05, top, 4000)
    over = np.array([quarter_car(v, *wave) for v in speeds]) > limit
    return float(speeds[np.argmax(over)]) if over.any() else np.inf


@pytest.mark.parametrize(
    ("height", "length", "hertz", "damping"),
    [
        (0.02, 1.5, 2.5, 0.3),
        (0.03, 2.0, 2.5, 0.3),
        (0.015, 1.0, 2.5, 0.3),
        (0.03, 2.0, 1.5, 0.5),
        (0.02, 2.0, 2.0, 0.15),
    ],
)
def test_a_washboard_slows_as_the_closed_form_says(
    height: float, length: float, hertz: float, damping: float
) -> None:
    tables = tables_with(vehicle={"ride_frequency": hertz, "ride_damping": damping})
    expected = allowed(5.0, 4.0, height, length, hertz, damping)
    assert expected < 4.0
    hazards = met(ground(wave(height, length), 0.05, x=(-3.0, 27.0)), straight(24.0), tables)
    middle = hazards.hazards.rough_speed[200:-60, 0]
    assert hazards.bar == 0
    # Speeds between those that are tried are on the slow side.
    assert 0.90 * expected < middle.min() <= middle.max() < 1.05 * expected


def test_slopes_and_their_beginning_do_not_slow() -> None:
    ramp = ground(lambda x, y: 0.2 * np.maximum(x - 8.0, 0.0) ** 2 / (1.0 + np.abs(x - 8.0)))
    assert met(ramp, straight(20.0)).slowest == np.inf
    for rise in (0.26, -0.26):
        assert met(ground(lambda x, y, rise=rise: rise * x), straight(20.0)).slowest == np.inf


def test_it_slows_before_the_washboard_and_until_the_rear_wheels_are_over_it() -> None:
    def patch(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.04 * np.sin(2.0 * np.pi * x) * ((x > 9.0) & (x < 12.0))

    hazards = met(ground(patch), straight(20.0))
    x, rough = hazards.profile.x[:, 0], hazards.hazards.rough_speed[:, 0]
    slow = rough < 3.0
    assert x[slow].min() < 9.0
    assert x[slow].max() > 12.0
    assert not slow[x < 7.5].any()
    assert not slow[x > 15.5].any()


def test_a_resonance_blocks_the_speeds_beyond_it() -> None:
    """With little damping the body swings at 2 m/s and not at 4 m/s; 4 m/s is not reached."""
    tables = tables_with(vehicle={"ride_frequency": 1.0, "ride_damping": 0.05})
    args = (0.015, 2.0, 1.0, 0.05)
    assert quarter_car(2.0, *args) > 5.0 > quarter_car(3.6, *args)
    hazards = met(ground(wave(*args[:2]), x=(-3.0, 35.0)), straight(30.0), tables)
    assert hazards.hazards.rough_speed[200:-20, 0].max() < 2.1


def test_the_start_does_not_forget_the_ground_behind() -> None:
    """On the washboard from the first station on, as a cycle of a moving vehicle begins."""
    hazards = met(ground(wave(0.04, 1.0), x=(-9.0, 25.0)), straight(20.0))
    rough = hazards.hazards.rough_speed[:, 0]
    assert rough[:5].max() < 1.15 * rough[50:150].mean()


@pytest.mark.parametrize("short", [0.05, 1e-3, 1e-12])
def test_a_short_first_step_is_no_spacing(short: float) -> None:
    """A vehicle that crawls along its previous plan is next to a station of it; one that has
    nothing left to drive is at the last one."""
    scene, model = ground(wave(0.04, 1.0), x=(-9.0, 25.0)), model_of(tables_with())
    even = np.arange(0.0, 20.0, 0.1)
    hazards = []
    for along in (even, np.concatenate([[even[1] - short], even[1:]]), [0.0, short]):
        x = np.asarray(along, np.float64)[:, None]
        y, counts = np.zeros_like(x), np.array([len(x)])
        vehicle = model.vehicle
        profile = terrain_profile(scene, x, y, counts, vehicle)
        hazards.append(swept_hazards(scene, profile, model).rough_speed[:, 0])
    np.testing.assert_allclose(hazards[1][10:], hazards[0][10:], rtol=0.1)
    assert np.all(hazards[2] > 0.0)


@pytest.mark.parametrize("factor", [2.0, 4.0])
def test_more_acceleration_allows_more_speed(factor: float) -> None:
    scene = ground(wave(0.03, 1.0))
    less = met(scene, straight(20.0)).slowest
    more = met(scene, straight(20.0), tables_with(limits={"vertical_accel": 5.0 * factor})).slowest
    assert more > 1.2 * less


SIDE = 0.5 + 0.35 * 0.28
"""Half the width of the quad, up to the outer edges of its tyres [m]."""


@pytest.mark.parametrize("resolution", [0.1, 0.25, 0.5])
def test_ground_between_cells_reaches_the_body_where_it_ends(resolution: float) -> None:
    """Between a wall in the next row of cells and the row under the body the ground rises."""

    def bar(height: float, away: float) -> int:
        row = SIDE + away * resolution
        rows = resolution * np.ceil(4.0 / resolution)
        wall = box((9.0, 99.0), (row - 0.3 * resolution, row + 0.3 * resolution), height)
        return met(ground(wall, resolution, y=(row - rows, row + rows)), straight(20.0)).bar

    assert bar(2.0, 0.75) in (BODY, CLEARANCE)
    assert bar(2.0, 0.85) in (BODY, CLEARANCE)
    assert bar(2.0, 0.95) == 0
    assert bar(0.6, 0.75) == 0


def test_a_body_at_an_angle_to_the_cells_touches_their_corners() -> None:
    heading = np.pi / 6.0

    def bar(away: float) -> int:
        def unknown(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            across = y * np.cos(heading) - x * np.sin(heading)
            return (np.abs(across - SIDE - 0.1 * away) < 0.003) & (x > 5.0)

        turned = ground(lambda x, y: 0.0 * x, x=(-3.0, 15.0), y=(-3.0, 15.0), unknown=unknown)
        assert np.isnan(turned.elevation).any()
        return met(turned, straight(16.0, heading)).bar

    assert bar(0.62) == UNKNOWN
    assert bar(0.80) == 0


@pytest.mark.parametrize("axle", [0.6, -0.6], ids=["front", "rear"])
@pytest.mark.parametrize("gap", [0.03, 0.1, 0.2, 0.25])
@pytest.mark.parametrize("height", [1.3 * LIMIT, 0.3, 0.48, 1.0])
def test_a_wall_that_a_wheel_touches_at_the_start_is_not_climbed(
    axle: float, gap: float, height: float
) -> None:
    """A wheel of 0.28 m radius stands closer to it than that: most of its climb is behind."""
    wall = ground(box((axle + gap, 90.0), EVERYWHERE, height), 0.05)
    hazards = met(wall, straight(20.0))
    assert (hazards.station, hazards.bar in {STEP, BODY}) == (1, True), hazards.reason
    # Likewise where nothing behind the vehicle is known.
    unseen = np.where(np.arange(wall.elevation.shape[1]) * 0.05 - 3.0 < -0.7, np.nan, 0.0)
    half_seen = met(replace(wall, elevation=wall.elevation + unseen), straight(20.0))
    assert half_seen.station == 1


@pytest.mark.parametrize("slope", [0.0, 0.2, -0.2])
@pytest.mark.parametrize(
    "around",
    [
        box((-9.0, -0.6), EVERYWHERE, -1.0),  # the rear wheels have just climbed it
        box((-9.0, -0.91), EVERYWHERE, 1.0),
        box((-9.0, 9.0), (0.65, 2.0), 1.0),
        box((0.65, 0.75), EVERYWHERE, -0.5),  # a gap that the front wheels bridge
        box((-0.55, 90.0), EVERYWHERE, 0.8 * LIMIT),
    ],
    ids=["edge behind", "wall behind", "wall next to it", "gap", "low step"],
)
def test_a_vehicle_leaves_what_is_next_to_it(around: Height, slope: float) -> None:
    hazards = met(ground(lambda x, y: around(x, y) + slope * x, 0.05), straight(8.0))
    assert hazards.bar == 0, hazards.reason


@pytest.mark.parametrize("resolution", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("beyond", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("height", [0.25, -0.25, 0.3, -0.3])
def test_a_step_before_a_cliff_is_no_ramp(resolution: float, beyond: float, height: float) -> None:
    """Both together make the ground around steeper than any that explains a climb."""
    step = box((9.0, 90.0), EVERYWHERE, height)
    cliff = box((9.0 + beyond, 90.0), EVERYWHERE, 12.0 * height)
    hazards = met(ground(lambda x, y: step(x, y) + cliff(x, y), resolution), straight(20.0))
    axle = hazards.profile.station[hazards.station, 0] + 0.6
    assert (hazards.bar in {STEP, BODY}, axle < 9.0) == (True, True), hazards.reason
