"""Centres of rotation of both sides, forces at any number of contacts, the rule that decides."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.errors import ParameterError
from slopewise.models.laws.slip_track import slip_track
from slopewise.models.terrain.classes import by_rules
from slopewise.models.terrain.classifier import TerrainClassifier
from slopewise.models.terrain.force_distribution import contact_forces, weight_in_vehicle_frame
from slopewise.models.terrain.rotation_centres import rotation_centres
from slopewise.services.io.terrain_file import find_terrains, read_terrains

HUSKY = read_terrains(find_terrains("husky")).classes


def test_centres_by_hand_and_their_distance() -> None:
    # body at 0.5 m/s turning left at 0.4 rad/s; sides at 0.2 and 0.7 m/s
    left, right = rotation_centres(0.2, 0.7, 0.5, 0.4)
    assert (left, right) == pytest.approx((0.75, -0.5))
    assert left - right == pytest.approx(slip_track(0.7, 0.2, 0.4))
    mirrored = rotation_centres(0.7, 0.2, 0.5, -0.4)
    assert mirrored == pytest.approx((0.5, -0.75))


def four(length: float, width: float, height: float) -> np.ndarray:
    return np.array(
        [(x, y, -height) for y in (width / 2, -width / 2) for x in (length / 2, -length / 2)]
    )


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_four_wheels_are_18_to_21_with_21_corrected(pitch: float, roll: float) -> None:
    W, L, B, h = 294.3, 0.55, 0.6, 0.2
    normal = contact_forces(four(L, B, h), weight_in_vehicle_frame(W, pitch, roll))[:, 2]
    even = W / 4 * np.cos(roll) * np.cos(pitch)
    along, across = W / 2 * np.sin(pitch) * h / L, W / 2 * np.cos(pitch) * np.sin(roll) * h / B
    assert normal == pytest.approx(
        [
            even + along - across,
            even - along - across,
            even + along + across,
            even - along + across,
        ],
        abs=1e-9,
    )


@given(st.integers(3, 8), st.integers(0, 10_000))
def test_any_number_of_contacts_balances_force_and_moment(count: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    contacts, load = random.normal(size=(count, 3)), random.normal(size=6)
    forces = contact_forces(contacts, load)
    assert forces.sum(axis=0) == pytest.approx(-load[:3], abs=1e-6)
    assert np.cross(contacts, forces).sum(axis=0) == pytest.approx(-load[3:], abs=1e-6)


def test_two_contacts_do_not_hold_a_vehicle() -> None:
    load = np.array([0.0, 0.0, -100.0, 0.0, 50.0, 0.0])
    with pytest.raises(ParameterError, match="off one line"):
        contact_forces(np.array([[0.0, 0.3, -0.2], [0.0, -0.3, -0.2]]), load)


def test_a_slip_track_beyond_1_4_is_sand_whatever_else_holds() -> None:
    odd = (0.05, 0.28, 1.5)  # asphalt except for the slip track
    assert by_rules(HUSKY, odd).name == "beach_sand"
    answer = TerrainClassifier(HUSKY).classify(odd)
    assert answer.probabilities["asphalt"] == 0.0
    assert answer.name != "asphalt"
    assert by_rules(HUSKY, (0.05, 0.28, 1.39)).name == "asphalt"
    names = [by_rules(HUSKY, (f, m, 1.41)).name for f in (0.0, 0.2, 0.4) for m in (0.1, 0.2, 0.3)]
    assert set(names) == {"beach_sand"}


def test_deciding_needs_a_rule() -> None:
    sand = HUSKY.terrain[3].slip_track
    assert sand is not None
    with pytest.raises(ParameterError, match="a rule beside it"):  # words: ok
        dataclasses.replace(sand, rule=None)
