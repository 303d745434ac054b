"""What crests take from both forces, as bounds that stay linear in the speed at brake onset."""

from __future__ import annotations

import numpy as np

from models.arrays import Floats
from models.laws import crest
from planner.ground.forces import Forces
from planner.ground.terrain_profile import TerrainProfile


def over_crests(
    forces: Forces, profile: TerrainProfile, share: float, rear_lever: float, *, lagged: bool
) -> Forces:
    """Both forces with what the load loses over crests, (N, M).

    The speed of a stop is nowhere above that at its onset, so the loss at v_i is never too small.
    The lower bound keeps less of itself; the load that the rear axle loses raises the upper bound,
    because that is what the axle's bound knows: rear share = c − lever F_b/W.

    Args:
        forces: of surfaces, effects and margins. profile: terrain under the wheels.
        share: k, how much of the lost load the force loses; 0: none, the axle's load alone.
        rear_lever: cg_z / (L − cg_x).
        lagged: the force follows what it should be with a lag: the worst of the path then counts
            everywhere, for a force that has built up before a crest does not wait to be lost on it.
    """
    bend = _sharpest(profile)
    if lagged:
        bend = np.broadcast_to(bend.min(axis=0), bend.shape)
    slow, fast = forces.slowest, forces.fastest
    span = np.maximum(fast - slow, 1e-6)
    # Over the trained speeds the chord of what is kept, which is concave, lies below it; that it
    # may fall below 0 is on the safe side.
    at_slow, at_fast = (1.0 - share * crest.load_loss(v, bend) for v in (slow, fast))
    least = [
        np.minimum(force, force * kept)
        for force, kept in (
            (slow * forces.lower_slope + forces.lower_intercept, at_slow),
            (fast * forces.lower_slope + forces.lower_intercept, at_fast),
        )
    ]
    lower_slope = (least[1] - least[0]) / span
    # The product of a falling force and its falling share is convex: its chord is above it by this.
    sag = 0.25 * np.maximum(forces.lower_slope * (at_fast - at_slow), 0.0) * span
    lower_intercept = least[0] - slow * lower_slope - sag
    # And the chord of the loss, which is convex, above it.
    light, lightest = (crest.load_loss(v, bend) / rear_lever for v in (slow, fast))
    heavier = (lightest - light) / span
    return forces._replace(
        lower_slope=lower_slope,
        lower_intercept=lower_intercept,
        upper_slope=forces.upper_slope + heavier,
        upper_intercept=forces.upper_intercept + light - slow * heavier,
    )


def _sharpest(profile: TerrainProfile) -> Floats:
    """Vertical curvature of the sharper crest of the segments on both sides, (N, M) [1/m].

    Where ground is unknown on either end there is nothing to drive on.
    """
    length = np.diff(profile.station, axis=0)
    there = profile.known[:-1] & profile.known[1:] & (length > 1e-9)
    bend = np.divide(np.diff(profile.grade, axis=0), length, out=np.zeros_like(length), where=there)
    padded = np.pad(np.minimum(bend, 0.0), ((1, 1), (0, 0)))
    sharpest: Floats = np.minimum(padded[:-1], padded[1:])
    return sharpest
