"""Definition of an effect: everything that other packages need of it.

One file of this folder describes one effect; :mod:`slopewise.models.effects.registry` collects
them. Planner, simulation, search and reports know the attributes below and no effect by its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, TypeAlias

from slopewise.models.arrays import Elementwise
from slopewise.models.effects.stops_seen import StopsSeen

Values: TypeAlias = Mapping[str, float]
"""All parameters of one effect by name, optional ones filled in."""

ANY = (-math.inf, math.inf)
POSITIVE = (0.0, math.inf)


class Enters(Enum):
    """Where an effect enters the equation of motion, and what its law looks like there.

    Parameters follow the arguments that are named, in the order of :attr:`EffectLaw.parameters` and
    in their units. Speeds are in m/s, curvatures in 1/m, angles in rad, heat in J/kg, times in s.
    """

    GROUND = "law(place: Place, …): added to F_b/W"
    LASTING = "law(force, …): F_b/W from a run on; has `scale`, `delta` and `run`"
    MOTION = "law(speed, curvature, yaw, …): added to the deceleration [m/s²]; elementwise"
    LAG = "law(since onset, tau): share of F_b that is still missing"
    FADE = "law(heat, k, tau): share of F_b that hot brakes keep"
    CAP = "law(grade, roll, mu): the most that F_b/W can be"
    CREST = "law(speed, vertical curvature, k): share of F_b that is left over a crest"


class Place(NamedTuple):
    """Where the vehicle is; floats, or arrays that broadcast.

    Attributes:
        grade, roll, yaw: [rad]. x, y: map coordinates [m].
        session_time: since the session began [s].
    """

    grade: Elementwise
    roll: Elementwise
    x: Elementwise
    y: Elementwise
    yaw: Elementwise
    session_time: Elementwise = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One number of an effect.

    Attributes:
        unit: SI. bounds: physical sign and size. default: value of an optional parameter.
        typical: sizes beyond which another cause is more likely than the effect.
        plausible: sizes beyond which a model file has a mistake, mostly of the unit.
        step, relative_step: by which a fit tries it, the larger of both, the second as a share of
            its value. fitted: a fit moves it; a run's number, say, it does not.
        longer_stop: sign of the change that makes stops longer at any place, 0 if that depends
            on the place: both ends are then used, by :attr:`EffectLaw.max_force`.
        lighter_rear: the same for the change that unloads the rear axle more while braking.
    """

    unit: str
    step: float
    bounds: tuple[float, float] = ANY
    default: float | None = None
    typical: tuple[float, float] = ANY
    plausible: tuple[float, float] = ANY
    relative_step: float = 0.0
    fitted: bool = True
    longer_stop: int = 0
    lighter_rear: int = 0

    def step_at(self, value: float) -> float:
        """By which a fit tries it where it has a value."""
        return max(abs(value) * self.relative_step, self.step)

    @property
    def fit_bounds(self) -> tuple[float, float]:
        """Bounds that are both physical and typical."""
        return max(self.bounds[0], self.typical[0]), min(self.bounds[1], self.typical[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """How a drive log is searched for an effect.

    Attributes:
        columns: on a grid of the inner parameters, each with the (S, M) share of the weight that
            one unit of the strength adds to the braking.
        strength: parameter that columns are multiplied with. one_sided: it cannot be negative.
        offset: strength without effect.
        is_complete: a column is that of the effect with its inner parameters, which are all it has.
        pauses_distinguish: stops after pauses of different length distinguish it from others.
        placed: its inner parameters are the circle `x`, `y`, `radius`, which has no slope to follow
            and is found by trying.
        joint: parameters of the coefficients of (S, M, Q) columns that only together are the
            effect; None where a column alone is.
    """

    columns: Callable[[StopsSeen], Iterator[tuple[dict[str, float], Any]]]
    strength: str
    one_sided: bool
    offset: float = 0.0
    is_complete: bool = False
    pauses_distinguish: bool = False
    placed: bool = False
    joint: Callable[..., dict[str, float]] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectLaw:
    """One effect, before any data.

    Attributes:
        missing: description of what the base model does not contain.
        enters, law: where it enters, and its one formula.
        parameters: by name, in the order in which the law takes them.
        depends_on: channels required besides speed and grade, of :data:`CHANNELS`.
        axis: quantity along which it changes the force. where: description of that for parameters.
        experiment: stops that distinguish it from the model's coefficients.
        search: how logs are searched for it; None with `unsearched`, the reason.
        once: a model has at most one of it; others add up.
        kinks_at_level: zero on level ground, with a kink there.
        grown: its parameters with edges moved outward by a length [m]; None without edges.
        along: the law along whole stops, (S, M), where samples at an edge have partial weight.
        max_force: the most that a change of each parameter changes F_b/W, on slopes of 20° and
            within four hours. per_slope: the most that `k` is multiplied with for each radian by
            which grade or roll is off.
        only_reduces: it reduces the force and adds none, so that including it twice is safe.
        may_add: it gives force somewhere that the model without it does not.
    """

    missing: str
    enters: Enters
    law: Callable[..., Elementwise]
    parameters: dict[str, Parameter]
    axis: str
    experiment: str
    depends_on: frozenset[str] = frozenset()
    search: Search | None = None
    unsearched: str = ""
    where: Callable[[Values], str] | None = None
    once: bool = False
    kinks_at_level: bool = False
    grown: Callable[[Values, float], dict[str, float]] | None = None
    along: Callable[..., Any] | None = None
    max_force: Callable[[Values], dict[str, float]] = lambda _: {}
    per_slope: float = 0.0
    only_reduces: Callable[[Values], bool] = lambda _: False
    may_add: Callable[[Values], bool] | None = None

    @property
    def channels(self) -> frozenset[str]:
        """Channels that a log needs to show it."""
        return frozenset(name for d in self.depends_on for name in CHANNELS[d])

    def adds(self, values: Values) -> bool:
        """Whether it gives force somewhere that the model without it does not."""
        return not self.only_reduces(values) if self.may_add is None else self.may_add(values)


CHANNELS: dict[str, tuple[str, ...]] = {
    "roll": ("roll",),
    "yaw": ("yaw",),
    "turning": ("yaw_rate",),
    "place": ("x", "y"),
    "vertical_curvature": ("vertical_curvature",),
    "session_time": (),
    "heat": (),
}
"""What an effect may depend on, and the channels of a log that carry it; every log has the rest."""
