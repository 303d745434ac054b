"""Share of the demanded force that brakes bring: build-up, heat, friction, crests.

Source: Braking Sec. 5.2 names heat and friction; the laws are those of
:mod:`slopewise.models.effects`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtbtrs

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopGround, StopTable
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.effects import registry
from slopewise.models.effects.brake_fade import remaining_share
from slopewise.models.effects.brake_lag import missing_share
from slopewise.models.laws import crest, wheel_lockup
from slopewise.models.quantity import GRAVITY

_MIN_COOLING = 0.5  # shortest time constant of cooling that is computed [s]


def motion_of(hypothesis: Hypothesis) -> registry.MotionTerms:
    """Terms of motion of the model's effects and of those that were added."""
    model = hypothesis.model
    return registry.motion((*model.effect, *hypothesis.added), model.braking.sliding_friction)


def crest_of(hypothesis: Hypothesis) -> float | None:
    """Share of the load lost over a crest that the force loses; None where nothing is known."""
    return registry.crest_share((*hypothesis.model.effect, *hypothesis.added))


class Brought(NamedTuple):
    """Force that brakes bring, (S, M) each.

    Attributes:
        force: F_b/W once it has built up. given: what fade, friction and crests leave of
            it.
        passes: share of a small change of the force that they let through.
    """

    force: Floats
    given: Floats
    passes: Floats


def brought_force(
    table: StopTable,
    hypothesis: Hypothesis,
    demanded: Floats,
    speed: Floats,
    place: StopGround,
    time: Floats,
) -> Brought:
    """From the demanded force to that on the ground.

    Args:
        table: stops. hypothesis: model and effects. demanded: (S, M) F_b/W.
        speed: (S, M) [m/s]. place: what is met. time: (S, M) since the command [s].
    """
    terms = motion_of(hypothesis)
    since = np.maximum(time - hypothesis.dead_time, 0.0)
    force = lagged(demanded, since, terms.lag) if terms.lag > 0.0 else demanded
    cap = np.full_like(force, np.inf)
    if math.isfinite(terms.friction):
        cap = np.asarray(wheel_lockup.friction_cap(place.grade, place.roll, terms.friction))
    passes = np.ones_like(force)
    if terms.fade > 0.0:
        q = heat(table, terms.fade_tau, speed, time, hypothesis.dead_time)
        passes = remaining_share(q, terms.fade, terms.fade_tau)
    given = force * passes
    passes = np.where(given > cap, 0.0, passes)
    given = np.minimum(given, cap)
    share = crest_of(hypothesis)
    if share is not None:
        remaining = crest.remaining_force(speed, place.vertical_curvature, share)
        given, passes = given * remaining, passes * remaining
    return Brought(force, given, passes)


def lagged(demanded: Floats, since: Floats, lag: float) -> Floats:
    """First-order build-up from 0 at the onset along axis 1, exact for an even force in a step.

    f[k + 1] − keep[k] f[k] = middle[k] is a band of two diagonals; stops follow one another in it.
    """
    keep = missing_share(np.diff(since, axis=1), lag)
    force = np.zeros_like(demanded)
    np.multiply(0.5 * (demanded[:, 1:] + demanded[:, :-1]), 1.0 - keep, out=force[:, 1:])
    band = np.ones((2, force.size), order="F")
    band[1] = 0.0
    band[1].reshape(force.shape)[:, :-1] = -keep
    solved, _ = dtbtrs(band, force.reshape(-1, 1), uplo="L", diag="U")
    result: Floats = solved.reshape(force.shape)
    return result


def heat(table: StopTable, tau: float, speed: Floats, time: Floats, onset: float) -> Floats:
    """(S, M) brake heat per mass q [J/kg]: power of the braking force less cooling.

    The force is the measured one of each stop, at any friction, and even within it.
    """
    tau = max(tau, _MIN_COOLING)
    step = time[:, 1:2] - time[:, :1]
    braking = np.clip((time - onset) / step + 0.5, 0.0, 1.0)  # smooth in the onset
    power = GRAVITY * np.maximum(table.force, 0.0)[:, None] * speed * braking
    # q' = power − q/τ solved with its factor e^(t/τ); stops are short compared with τ.
    factor = np.exp((time - time[:, :1]) / tau)
    driven = power * factor
    within = np.zeros_like(power)
    np.cumsum(0.5 * (driven[:, 1:] + driven[:, :-1]) * step, axis=1, out=within[:, 1:])
    within /= factor
    ago, energy = table.warmed[:, 0], table.warmed[:, 1]
    before = np.sum(energy * np.exp(-ago / tau), axis=1)
    total: Floats = before[:, None] * np.exp(-np.maximum(time, 0.0) / tau) + within
    return total
