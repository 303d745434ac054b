"""What statuses and bounds are called on a page, and what they mean in half a sentence."""

from __future__ import annotations

from planner.limiting import Limiting
from planner.plan import Status

STATUS_MEANING: dict[Status, str] = {
    Status.OK: "reaches the end of its path",
    Status.BLOCKED: "a valid plan that stops before some station",
    Status.DEGRADED: "safe, but a fallback was used",
    Status.INFEASIBLE: "even full braking from the start is not enough",
}

LIMITING_MEANING: dict[Limiting, str] = {
    Limiting.SPEED_LIMIT: "the speed limit of the vehicle or of the path",
    Limiting.STOPPING_PATH: "an emergency stop must end before the clear distance does",
    Limiting.TIP_OVER: "an axle would lose too much load in an emergency stop",
    Limiting.ROLLOVER: "a side would lose too much load, in the turn or in a stop",
    Limiting.LATERAL: "lateral acceleration in the turn",
    Limiting.WHEEL_SPEED: "the outer wheels turn as fast as they can",
    Limiting.TRACTION: "thrust or power of the drive",
    Limiting.ACCEL: "speeding up as fast as allowed",
    Limiting.DECEL: "service braking as hard as allowed",
    Limiting.JERK: "acceleration must change smoothly",
    Limiting.UNKNOWN_TERRAIN: "unknown ground ahead bars the way",
    Limiting.MODEL_VALIDITY: "beyond the speeds or grades that the model was trained on",
}


def word(limiting: Limiting) -> str:
    """The name of a bound for people, e.g. "stopping path"."""
    return limiting.label.replace("_", " ")
