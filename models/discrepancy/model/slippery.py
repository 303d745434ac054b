"""Friction that caps the force, on all ground or in places: what is left where wheels slide.

A wet or icy place does not change the force by the same everywhere in it. Brakes that would bring
more than its friction lock, and bring no more whatever the slope; on a cross slope the vehicle
drifts as well. Brakes that would bring less feel nothing. The model's own effect knows one change
of force for a place, so this is how explanations are weighed, not what is written.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.discrepancy.data.stop_ground import StopGround
from slopewise.models.discrepancy.thresholds import LEAST_FRICTION
from slopewise.models.effects.surface_patch import share_inside
from slopewise.models.laws.sideways_slide import share_along
from slopewise.models.laws.wheel_lockup import friction_cap
from slopewise.models.parameters import Effect


def given_under(
    cap: Floats,
    force: Floats,
    friction: Floats | float,
    place: StopGround,
    slowed: Floats,
    *,
    drifts: bool,
) -> tuple[Floats, Bools]:
    """(S, M) what a friction cap leaves of a force F_b/W, and where wheels slide.

    Args:
        cap: (S, M) by the friction, μ_s. force, place, slowed, drifts: as of
            :func:`taken_by_sliding`.
    """
    slides = force > cap
    if drifts and slides.any():
        cap = cap * share_along(slowed, place.grade, place.roll, friction)
    return np.where(slides, cap, force), slides


def taken_by_sliding(
    patch: Effect, force: Floats, level: Floats, place: StopGround, slowed: Floats, *, drifts: bool
) -> Floats:
    """(S, M) what a slippery place adds to F_b/W, never more than 0.

    Args:
        patch: its δ is the change on level ground. force: (S, M) that is wanted, F_b/W.
        level: (S, 1) that on level ground. place: what is met.
        slowed: (S, M) speed as a share of that at the command. drifts: wheels slide sideways, too.
    """
    p = patch.parameters
    friction = np.maximum(level + p["delta"], LEAST_FRICTION)
    cap = np.asarray(friction_cap(place.grade, place.roll, friction))
    given, _ = given_under(cap, force, friction, place, slowed, drifts=drifts)
    taken: Floats = given - force
    taken *= share_inside(place.x, place.y, p["x"], p["y"], p["radius"])
    return taken
