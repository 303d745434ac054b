"""A stop compared with its prediction, and the models on which braking can be learned."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slopewise.models.effects.registry import LAWS
from slopewise.models.laws import braking
from slopewise.models.parameters import Braking, Effect, Model
from slopewise.models.stop_logs.stop_stream import StreamedStop
from slopewise.services.parameters.stop_plausibility import deceleration_of


@dataclass(frozen=True, slots=True)
class LearnedStop:
    """A stop and the prediction from before it was learned from."""

    at: float  # monotonic clock [s]
    source: str  # source, surface: sender, and surface of the stop
    surface: str
    speed: float  # at the stop command [m/s]
    grade: float  # [rad]
    predicted: float  # predicted, actual: distance from command to rest on a uniform slope [m]
    actual: float
    outcome: str  # result of the update, one word


def predicted_distance(used: Braking, dead_time: float, stop: StreamedStop) -> float:
    """Distance of a stop by a braking model, with brakes that respond after a dead time [m]."""
    force = (used.m_m * stop.onset_speed + used.b_m) * stop.grade
    force += used.m_b * stop.onset_speed + used.b_b
    deceleration = braking.deceleration(force, stop.grade)
    if not deceleration > 0.0:
        return math.inf
    dead_time = max(used.dead_time, dead_time)
    distance = braking.stopping_distance(
        stop.onset_speed, deceleration, dead_time, used.distance_offset
    )
    return float(distance)


def measured_distance(stop: StreamedStop, dead_time: float) -> float:
    """Distance of a measured stop; ``dead_time`` [s] is used where it was not measured [m]."""
    dead_time = dead_time if math.isnan(stop.dead_time) else stop.dead_time
    braking_distance = stop.onset_speed**2 / (2.0 * deceleration_of(stop))
    return stop.onset_speed * dead_time + braking_distance


def unsupported_reason(model: Model, owner: str = "the model file") -> str:
    """Reason why braking cannot be learned on top of a model; empty if it can.

    Stops measure the force with all that helps to brake. Force that the model adds as an effect, or
    holds separately, would be counted twice; effects that only reduce it make plans slower.
    ``owner`` names the model in the text.
    """
    if model.braking.uphill is not None:
        return f"braking is not learned: {owner} has separate uphill coefficients"
    if model.braking.level < 1.0:
        return f"braking is not learned: {owner} is of a brake level below 1"
    more = [e.name for e in model.effect if not LAWS[e.name].only_reduces(e.parameters)]
    return f"braking is not learned: {owner} has the effect {more[0]}" if more else ""


def counts_twice(model: Model) -> bool:
    """Return True if learned force holds force that the model's effects add already."""
    return bool(unsupported_reason(model)) and any(adds_force(effect) for effect in model.effect)


def adds_force(effect: Effect) -> bool:
    """Return True if an effect adds force somewhere beyond the braking model alone."""
    return LAWS[effect.name].adds(effect.parameters)
