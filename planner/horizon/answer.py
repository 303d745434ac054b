"""Input and output of a cycle of the moving horizon."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import MAX_SPEED, quantity, validate_quantities
from slopewise.models.typed_arguments import check_fields
from slopewise.planner.plan import SpeedPlan, Status

MAX_HEADING_ERROR = 0.3
"""Largest angle between path and heading [rad]: up to it (17°) the linear law of the tracker, by
which the return to the path is swept, is good to 5 % of the offset."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HorizonSettings:
    """How one cycle works, and when it changes its mind."""

    budget: float = quantity(
        "s", "Time for one cycle; what does not fit is smoothing.", default=0.02, above=0.0
    )
    smoothed: int = 4
    period: float = quantity("s", "From one cycle to the next.", default=0.1, above=0.0)
    switch_gain: float = quantity(
        "s",
        "By how much, besides a station of progress, a candidate must be better than the previous "
        "plan to be chosen.",
        default=0.3,
        at_least=0.0,
    )
    beside: float = quantity(
        "m",
        "Farthest that a path may lie beside the vehicle; half the track width where that is less.",
        default=0.5,
        above=0.0,
    )
    ahead: float = quantity(
        "m", "Farthest that a path may begin ahead of the vehicle.", default=1.0, above=0.0
    )
    turned: float = quantity(
        "rad",
        "Largest angle between a path and the heading.",
        default=MAX_HEADING_ERROR,
        above=0.0,
        at_most=MAX_HEADING_ERROR,
    )
    same_path: float = quantity(
        "m", "How exactly a path of the same name is the same path.", default=0.1, above=0.0
    )
    speed_error: float = quantity(
        "m/s", "Difference to the planned speed that tracking removes.", default=0.1, at_least=0.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        if self.smoothed < 1:
            raise ParameterError("smoothed", f"at least 1 candidate, got {self.smoothed}")

    def for_track(self, track_width: float) -> HorizonSettings:
        """The same where ``beside`` is no more than half the track of the vehicle [m]."""
        return replace(self, beside=min(self.beside, 0.5 * track_width))


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarState:
    """Where the vehicle is: the middle of its wheelbase, in map coordinates.

    Attributes:
        x, y: [m]. heading: of any number of turns [rad]. speed: along the heading [m/s].
        age: time since all that was measured, where known [s].
    """

    x: float
    y: float
    heading: float
    speed: float
    age: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self)

    def invalid_field(self) -> str:
        """Fault that makes it unusable, empty without one."""
        for name in ("x", "y", "heading", "speed", "age"):
            if not np.isfinite(getattr(self, name)):
                return f"state.{name} is {getattr(self, name)}"
        if self.age < 0.0:
            return f"state.age is {self.age:g} s, in the future"
        if self.speed > MAX_SPEED:
            return f"state.speed is {self.speed:g} m/s, which no vehicle has"
        return f"state.speed is {self.speed:g} m/s, backwards" if self.speed < -0.05 else ""


@dataclass(frozen=True, slots=True)
class SpeedCommand:
    """Command until the next cycle.

    Attributes:
        speed: to be reached after one period [m/s].
        accel: now [m/s²].
        stop: brake as hard as the brakes can, now.
        valid_for: how long the plan may be followed without another answer; it ends at rest [s].
    """

    speed: float
    accel: float
    stop: bool
    valid_for: float


FULL_STOP = SpeedCommand(0.0, 0.0, True, 0.0)
"""Command of a client that has no plan: stand still, brakes fully on [m/s, m/s²]."""


@dataclass(frozen=True, slots=True)
class Deficit:
    """Deficit of the previous plan, now that something got worse.

    Attributes:
        amount: by how much, in the unit of the bound.
        distance: from the vehicle to where that is, along the plan [m].
        bound: what is breached, as in :class:`slopewise.planner.verify.verifier.Violations`.
    """

    amount: float
    distance: float
    bound: str

    def sentence(self) -> str:
        """The deficit as text."""
        return f"{self.bound} by {self.amount:.3g} in {self.distance:.2f} m"


@dataclass(frozen=True, slots=True)
class Ranked:
    """One candidate of a cycle.

    Attributes:
        candidate: name.
        cost: travel time and what is missed [s], inf where it was not planned.
        valid: the verifier has no objection to its time-optimal profile.
        reason: why it was not planned, or what the verifier objects to.

    The way of a vehicle off its lines counts for the best candidates; the cost and the verdict of
    the others are those of the line alone.
    """

    candidate: str
    cost: float
    valid: bool
    reason: str


@dataclass(frozen=True, slots=True)
class CycleAnswer:
    """The answer of one cycle.

    Attributes:
        status, reason: those of the chosen plan, if there is one.
        chosen: the plan to drive, None where there is nothing to drive along.
        command: what to do now; always there.
        plans: those that were finished, best first; the previous one may be among them.
        ranking: all candidates, best first.
        deficit: what the previous plan lacks, None if that was not asked or is nothing.
        kept: the previous plan is continued unchanged.
        seconds: what each stage took.
    """

    status: Status
    reason: str
    chosen: SpeedPlan | None
    command: SpeedCommand
    plans: tuple[SpeedPlan, ...] = ()
    ranking: tuple[Ranked, ...] = ()
    deficit: Deficit | None = None
    kept: bool = False
    seconds: dict[str, float] = field(default_factory=dict)


def command_of(plan: SpeedPlan, now: float, late: float, period: float) -> SpeedCommand:
    """Command at a time of a plan, or at a later one if the plan is slower then.

    Args:
        plan: followed from there.
        now: time of the plan at which the vehicle is, as far as it obeyed [s].
        late: the same if it did not begin with the plan only now [s].
        period: until the next cycle [s].
    """
    return min((_command_at(plan, time, period) for time in (now, late)), key=lambda c: c.speed)


def _command_at(plan: SpeedPlan, now: float, period: float) -> SpeedCommand:
    k = int(np.clip(np.searchsorted(plan.time, now, "right") - 1, 0, len(plan.time) - 2))
    later = now + period
    m = int(np.searchsorted(plan.time, later, "right")) - 1
    speed = 0.0
    if later < plan.travel_time:
        speed = max(float(plan.speed[m] + plan.accel[m] * (later - plan.time[m])), 0.0)
    return SpeedCommand(speed, float(plan.accel[k]), False, max(plan.travel_time - now, 0.0))
