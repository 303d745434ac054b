"""Rough ground slows, swells do not; on a sine the quarter car has a closed form."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.swept.hazards import swept_hazards
from tests.world.ground import Height, straight
from tests.world.hazards import ground, met
from tests.world.vehicles import model_of, tables_with


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
    middle = hazards.hazards.rows.rough_speed[200:-60, 0]
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
    x, rough = hazards.profile.x[:, 0], hazards.hazards.rows.rough_speed[:, 0]
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
    assert hazards.hazards.rows.rough_speed[200:-20, 0].max() < 2.1


def test_the_start_does_not_forget_the_ground_behind() -> None:
    """On the washboard from the first station on, as a cycle of a moving vehicle begins."""
    hazards = met(ground(wave(0.04, 1.0), x=(-9.0, 25.0)), straight(20.0))
    rough = hazards.hazards.rows.rough_speed[:, 0]
    assert rough[:5].max() < 1.15 * rough[50:150].mean()


@pytest.mark.parametrize("short", [0.05, 1e-3, 1e-7])
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
        profile = terrain_profile(scene, x, y, counts, vehicle.wheelbase, vehicle.track_width)
        hazards.append(swept_hazards(scene, profile, model).rows.rough_speed[:, 0])
    np.testing.assert_allclose(hazards[1][10:], hazards[0][10:], rtol=0.1)
    assert np.all(hazards[2] > 0.0)


@pytest.mark.parametrize("factor", [2.0, 4.0])
def test_more_acceleration_allows_more_speed(factor: float) -> None:
    scene = ground(wave(0.03, 1.0))
    less = met(scene, straight(20.0)).slowest
    more = met(scene, straight(20.0), tables_with(limits={"vertical_accel": 5.0 * factor})).slowest
    assert more > 1.2 * less
