"""Which model files braking can be learned on top of, and what a stop has told."""

from __future__ import annotations

from dataclasses import dataclass

from models.parameters import Effect, Model

_TAKING = ("brake_lag", "brake_fade", "wheel_lockup")
"""Effects that only take force away: counted twice, once in what stops teach, they slow plans."""


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
    keeps apart, would be counted twice.
    """
    if model.braking.uphill is not None:
        return f"braking is not learned: {whose} has uphill coefficients of their own"
    if model.braking.level < 1.0:
        return f"braking is not learned: {whose} is of a brake level below 1"
    more = [effect.name for effect in model.effect if not _only_takes(effect)]
    return f"braking is not learned: {whose} has the effect {more[0]}" if more else ""


def _only_takes(effect: Effect) -> bool:
    lean = effect.name == "cross_slope" and effect.parameters["k"] <= 0.0
    return lean or effect.name in _TAKING


def may_add(effect: Effect) -> bool:
    """Whether an effect gives force somewhere that the braking model alone does not."""
    p = effect.parameters
    match effect.name:
        case "step_change":
            return p.get("scale", 1.0) > 1.0 or p.get("delta", 0.0) > 0.0
        case "surface_patch":
            return p["delta"] > 0.0
        case "grade_asymmetry" | "session_drift":
            return p["k"] > 0.0
        case "crest_unloading":
            return False
        case _:
            return not _only_takes(effect)
