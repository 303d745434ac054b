"""Load lost over a crest, against free bodies written out here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from slopewise.models.laws.crest import crest_speed_sq, dip_speed_sq, load_loss, remaining_force
from slopewise.models.parameters import Effect
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from tests.models.models_for_tests import BASE
from tests.models.parity import G, check_parity


def test_a_crest_seen_in_a_physics_engine() -> None:
    """From 1.6° uphill to 12° downhill within 3 m, at 4 m/s: 13 % of the normal load."""
    curvature = np.deg2rad(-12.0 - 1.6) / 3.0
    assert load_loss(4.0, curvature) == pytest.approx(0.13, abs=0.005)


@given(radius=st.floats(5.0, 100.0), speed=st.floats(0.5, 6.0))
def test_on_a_round_hill_the_load_loss_is_the_centripetal_force(
    radius: float, speed: float
) -> None:
    """A point that slides over the top of a circle: acceleration by differences."""
    dt = 1e-4
    angle = speed * np.array([-dt, 0.0, dt]) / radius
    height = radius * np.cos(angle)
    falling = (height[0] - 2.0 * height[1] + height[2]) / dt**2
    pressing = (G + falling) / G
    assert 1.0 - load_loss(speed, -1.0 / radius) == pytest.approx(pressing, abs=1e-4)


@given(curvature=st.floats(0.0, 0.2), speed=st.floats(0.0, 6.0), share=st.floats(0.0, 2.0))
def test_a_hollow_adds_no_force(curvature: float, speed: float, share: float) -> None:
    assert load_loss(speed, curvature) == 0.0
    assert remaining_force(speed, curvature, share) == 1.0


def test_a_vehicle_that_flies_brakes_with_nothing_but_never_pushes() -> None:
    assert remaining_force(6.0, -1.0, 1.0) == 0.0


def test_parity() -> None:
    check_parity(load_loss, speed=(0.0, 5.0), vertical_curvature=(-0.4, 0.1))
    check_parity(
        remaining_force, speed=(0.0, 5.0), vertical_curvature=(-0.2, 0.05), share=(0.0, 1.5)
    )
    check_parity(
        crest_speed_sq,
        min_share_without_crest=(0.5, 1.0),
        min_share=(0.05, 0.4),
        vertical_curvature=(-0.4, -0.02),
    )
    check_parity(dip_speed_sq, vertical_accel=(1.0, 8.0), vertical_curvature=(0.02, 0.4))


def test_the_fastest_over_a_crest_and_through_a_dip() -> None:
    """Radius 4 m: 6.26 m/s where all load goes; a share kept lowers v² by as much."""
    assert crest_speed_sq(1.0, 0.0, -0.25) == pytest.approx(6.26**2, abs=0.05)
    assert crest_speed_sq(0.9, 0.2, -0.25) == pytest.approx(4.0 * G * 0.7)
    assert crest_speed_sq(0.1, 0.2, -0.25) == 0.0
    assert crest_speed_sq(0.9, 0.2, 0.1) > 1e200
    assert dip_speed_sq(5.0, 0.25) == pytest.approx(20.0)
    assert dip_speed_sq(5.0, -0.25) > 1e200


def test_a_simulated_stop_over_a_crest_is_that_of_the_energy_along_the_way() -> None:
    """d(v²/2)/ds = −g (F (1 − k v² |κ|/g) + sin θ), θ = κ s: along the path, not in time."""
    k, curvature, speed = 0.9, -0.06, 3.5
    crest = Effect(name="crest_unloading", parameters={"k": k})
    station, zero = np.linspace(0.0, 9.0, 4), np.zeros(4)
    track = GroundTrack(station, curvature * station, zero, zero, zero, zero, zero)
    onset = 0.3 * speed

    def energy(s: float, e: np.ndarray) -> list[float]:
        theta, v_sq = curvature * s, 2.0 * e[0]
        force = (-0.03 * speed - 0.35) * theta + 0.015 * speed + 0.40
        return [-G * (force * (1.0 - k * v_sq * abs(curvature) / G) + np.sin(theta))]

    def rest(_: float, e: np.ndarray) -> float:
        return float(e[0])

    rest.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(energy, (onset, 9.0), [0.5 * speed**2], events=rest, rtol=1e-9, atol=1e-10)
    distance = simulate_stop(replace(BASE, effect=(crest,)), track, speed).distance
    assert distance == pytest.approx(float(run.t[-1]), abs=1e-4)
    assert distance > simulate_stop(BASE, track, speed).distance + 0.05
