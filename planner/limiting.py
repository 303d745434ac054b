"""Bounds that can limit a plan at a station, with the data of each besides its formula.

To add a bound: a member and an entry here, its code in `core/bounds/limiting.hpp`, and the line
that lowers v² by it in `core/bounds/pointwise.hpp`. Files, screens, pages and explanations take
its name, words, colour and what lifts it from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum


class Limiting(IntEnum):
    """The bound that holds at a station. Order breaks ties: the earlier name wins."""

    SPEED_LIMIT = 0
    STOPPING_PATH = 1
    TIP_OVER = 2
    ROLLOVER = 3
    LATERAL = 4
    WHEEL_SPEED = 5
    TRACTION = 6
    ACCEL = 7
    DECEL = 8
    JERK = 9
    UNKNOWN_TERRAIN = 10
    MODEL_VALIDITY = 11
    STEP = 12
    CLEARANCE = 13
    BODY = 14
    ROUGHNESS = 15
    CREST = 16
    FRICTION = 17
    HOLDING = 18
    STEERING = 19

    @property
    def label(self) -> str:
        """The word in files and on screens, e.g. ``stopping_path``."""
        return self.name.lower()


@dataclass(frozen=True, slots=True)
class Lift:
    """How a what-if question takes a bound away (:mod:`slopewise.planner.explain.relaxed`).

    Attributes:
        assumptions: what is assumed instead, by name.
        of_hazards: body and wheels do not meet what is bounded so.
        out_of_reach: limits of the model that are moved out of reach, as ``table.name``.
        relaxation: name of what is done to the model where moving a limit is not enough.
    """

    assumptions: Mapping[str, bool] = field(default_factory=dict)
    out_of_reach: tuple[str, ...] = ()
    relaxation: str = ""
    of_hazards: bool = False


@dataclass(frozen=True, slots=True)
class Bound:
    """Data of a bound besides its name.

    Attributes:
        meaning: half a sentence for pages.
        law: where it is computed, as ``module:function``.
        lift: how a what-if question takes it away.
        colour, colour_on_dark: on pages; the second one only where it differs.
        dark_text: text on its colour is dark.
    """

    meaning: str
    law: str
    lift: Lift
    colour: str
    colour_on_dark: str = ""
    dark_text: bool = False


BOUNDS: dict[Limiting, Bound] = {
    Limiting.SPEED_LIMIT: Bound(
        "the speed limit of the vehicle or of the path",
        "slopewise.planner.bounds.speed_bounds:speed_bounds",
        Lift({"path_limits": False}, relaxation="as_fast_as_trained"),
        "#8d949b",
        dark_text=True,
    ),
    Limiting.STOPPING_PATH: Bound(
        "an emergency stop must end before the clear distance does",
        "slopewise.planner.bounds.speed_bounds:speed_bounds",
        Lift({"stops_at_once": True}),
        "#d55e00",
    ),
    Limiting.TIP_OVER: Bound(
        "an axle would lose too much load in an emergency stop",
        "slopewise.models.laws.wheel_loads:rear_load_share",
        Lift(relaxation="far_axles"),
        "#cc79a7",
        dark_text=True,
    ),
    Limiting.ROLLOVER: Bound(
        "a side would lose too much load, in the turn or in a stop",
        "slopewise.models.laws.rollover:lateral_accel_limits",
        Lift(relaxation="far_sides"),
        "#882255",
        "#c2447f",
    ),
    Limiting.LATERAL: Bound(
        "lateral acceleration in the turn",
        "slopewise.models.laws.rollover:path_lateral_accel",
        Lift(out_of_reach=("limits.lateral_accel",)),
        "#0072b2",
        "#3f9be0",
    ),
    Limiting.WHEEL_SPEED: Bound(
        "the outer wheels turn as fast as they can",
        "slopewise.models.laws.slip_track:outer_wheel_speed_ratio",
        Lift(out_of_reach=("vehicle.max_wheel_speed",)),
        "#b79a3a",
        dark_text=True,
    ),
    Limiting.TRACTION: Bound(
        "thrust or power of the drive",
        "slopewise.models.laws.drive:sustained_speed",
        Lift(out_of_reach=("vehicle.max_drive_force", "vehicle.max_drive_power")),
        "#6f7d1e",
        "#9bab3a",
    ),
    Limiting.ACCEL: Bound(
        "speeding up as fast as allowed",
        "slopewise.planner.bounds.speed_bounds:speed_bounds",
        Lift(out_of_reach=("limits.accel",)),
        "#56b4e9",
        dark_text=True,
    ),
    Limiting.DECEL: Bound(
        "service braking as hard as allowed",
        "slopewise.planner._core:time_optimal",
        Lift(out_of_reach=("limits.decel",)),
        "#e6a100",
        dark_text=True,
    ),
    Limiting.JERK: Bound(
        "acceleration must change smoothly",
        "slopewise.planner.profile.smoothing:smooth",
        Lift({"smooth": False}),
        "#2fa08c",
        dark_text=True,
    ),
    Limiting.UNKNOWN_TERRAIN: Bound(
        "unknown ground ahead blocks the path",
        "slopewise.planner.bounds.speed_bounds:speed_bounds",
        Lift({"ground_known": True}),
        "#3a3f44",
        "#a9afb5",
    ),
    Limiting.MODEL_VALIDITY: Bound(
        "beyond the speeds or grades that the model was trained on",
        "slopewise.planner.bounds.speed_bounds:speed_bounds",
        Lift({"trained_everywhere": True}),
        "#4b3f9e",
        "#8f83e6",
    ),
    Limiting.STEP: Bound(
        "a step, a drop or a hole is too high for a wheel",
        "slopewise.planner.swept.hazards:swept_hazards",
        Lift(of_hazards=True),
        "#7a4a1e",
        "#b98352",
    ),
    Limiting.CLEARANCE: Bound(
        "the ground between the wheels is higher than the underside",
        "slopewise.planner.swept.hazards:swept_hazards",
        Lift(of_hazards=True),
        "#a65e2e",
        "#cf8a58",
    ),
    Limiting.BODY: Bound(
        "the body would strike what stands ahead of, behind or beside the wheels",
        "slopewise.planner.swept.hazards:swept_hazards",
        Lift(of_hazards=True),
        "#5c2b12",
        "#a8724f",
    ),
    Limiting.ROUGHNESS: Bound(
        "vertical acceleration of the body on rough ground",
        "slopewise.planner.swept.hazards:rough_speeds",
        Lift(out_of_reach=("limits.vertical_accel",)),
        "#c49a6c",
        dark_text=True,
    ),
    Limiting.CREST: Bound(
        "wheels would press too little over a crest, or the body too much in a dip",
        "slopewise.models.laws.crest:crest_speed_sq",
        Lift({"ground_even": True}),
        "#2b7a78",
        "#58b3b0",
    ),
    Limiting.FRICTION: Bound(
        "friction of the ground, shared by slope, turn and brakes",
        "slopewise.models.laws.friction_ellipse:lateral_speed_sq",
        Lift(relaxation="any_friction"),
        "#3d6fb4",
        "#7da4dc",
    ),
    Limiting.HOLDING: Bound(
        "brakes and friction could not hold the vehicle at rest",
        "slopewise.models.laws.holding:brakes_hold",
        Lift({"holds_anywhere": True}),
        "#9c2f4a",
        "#d9708a",
    ),
    Limiting.STEERING: Bound(
        "a turn is tighter than the steering allows, or begins too suddenly",
        "slopewise.planner.ground.steering_limits:steering_limits",
        Lift(relaxation="any_turn"),
        "#6a5acd",
        "#9d90f0",
    ),
}
