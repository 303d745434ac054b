"""Which model files braking can be learned on top of, and what a stop has told."""

from __future__ import annotations

from dataclasses import dataclass

from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Effect, Model


@dataclass(frozen=True, slots=True)
class StopTaught:
    """A stop beside what was predicted of it before it was learned from.

    Attributes:
        at: monotonic clock [s]. surface, source: where and by whom. speed: [m/s]. grade: [rad].
        predicted, actual: from command to rest on an even slope [m]. outcome: what became of it.
    """

    at: float
    source: str
    surface: str
    speed: float
    grade: float
    predicted: float
    actual: float
    outcome: str


def unable(model: Model, whose: str = "the model file") -> str:
    """Why braking cannot be learned on top of a model; empty if it can. ``whose``: for the words.

    Stops measure the force with all that helps to brake. What the model adds to it as an effect, or
    keeps apart, would be counted twice; what only takes force away then makes plans slower.
    """
    if model.braking.uphill is not None:
        return f"braking is not learned: {whose} has uphill coefficients of their own"
    if model.braking.level < 1.0:
        return f"braking is not learned: {whose} is of a brake level below 1"
    more = [e.name for e in model.effect if not LAWS[e.name].only_reduces(e.parameters)]
    return f"braking is not learned: {whose} has the effect {more[0]}" if more else ""


def may_add(effect: Effect) -> bool:
    """Whether an effect gives force somewhere that the braking model alone does not."""
    return LAWS[effect.name].adds(effect.parameters)
