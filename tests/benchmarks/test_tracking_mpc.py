"""The example of a controller that takes the model along stops before what is known free."""

from __future__ import annotations

import pytest

pytest.importorskip("mujoco", reason="the sim extra is not installed")


def test_a_controller_of_ones_own_keeps_the_stopping_path() -> None:
    from examples.tracking_mpc import drive

    done = drive(0)
    assert done.past_clear == 0
    assert done.collisions == 0
    assert done.distance > 20.0
    assert done.mean_speed > 0.8
