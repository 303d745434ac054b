"""All effects that extend the base braking model, and their sum.

The base is Braking (7)–(8): a force fixed by grade and by the speed at brake onset, after a pure
dead time. Each effect has one file in this folder that says everything about it, and one line here.

Where several act on the force: ground terms and lasting changes make the demanded force,
pressure builds it up (lag), hot pads reduce it (fade), friction caps the result, and a crest takes
its share of that. Motion terms add to the deceleration.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
from importlib import import_module
from itertools import islice
from typing import NamedTuple

from slopewise.models.arrays import Elementwise
from slopewise.models.effects.effect_law import EffectLaw, Enters, Place
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Effect

_FILES = (
    "aerodynamic_drag",
    "headwind",
    "viscous_resistance",
    "brake_lag",
    "brake_fade",
    "wheel_lockup",
    "grade_asymmetry",
    "grade_nonlinearity",
    "crest_unloading",
    "cross_slope",
    "turning_resistance",
    "surface_patch",
    "directional_surface",
    "step_change",
    "session_drift",
)

LAWS: dict[str, EffectLaw] = {
    name: import_module(f"slopewise.models.effects.{name}").EFFECT for name in _FILES
}
"""Every effect by the name of its file."""

MOTION_LAWS = tuple(name for name, law in LAWS.items() if law.enters is Enters.MOTION)
"""Effects whose laws are added to the deceleration, in the order of :attr:`MotionTerms.values`."""


def law_of(effect: Effect) -> EffectLaw:
    """Definition of an effect.

    Raises:
        ParameterError: unknown name.
    """
    law = LAWS.get(effect.name)
    if law is None:
        raise ParameterError("name", f"one of {', '.join(LAWS)}; got {effect.name!r}")
    return law


def validate(effect: Effect) -> dict[str, float]:
    """All parameters of an effect, optional ones filled in, in the order of its law.

    Raises:
        ParameterError: unknown effect or parameter, or a value outside its physical bounds.
    """
    law = law_of(effect)
    for name in effect.parameters:
        if name not in law.parameters:
            raise ParameterError(
                f"parameters.{name}",
                f"only {', '.join(law.parameters)} as parameters of {effect.name}",
            )
    values = {}
    for name, parameter in law.parameters.items():
        value = effect.parameters.get(name, parameter.default)
        low, high = parameter.bounds
        if value is None:
            unit = parameter.unit
            raise ParameterError(f"parameters.{name}", f"a number [{unit}] for {effect.name}")
        if not (math.isfinite(value) and low <= value <= high):
            raise ParameterError(
                f"parameters.{name}",
                f"a number in [{low:g}, {high:g}] [{parameter.unit}], got {value!r}",
            )
        values[name] = value
    return values


class MotionTerms(NamedTuple):
    """Terms that act while the vehicle brakes, in the form that an integrator requires.

    Attributes:
        values: parameters of all :data:`MOTION_LAWS`, one effect after the other; 0 if absent.
        moves: whether any of these laws is there.
        lag: time constant of the build-up, 0 without [s].
        fade: k of F/(1 + k q) [kg/J]; dq/dt = braking power per mass − q/fade_tau.
        fade_tau: cooling time constant [s].
        heat: q at the stop command [J/kg].
        friction: cap of F_b/W on level ground, inf without.
    """

    values: tuple[float, ...]
    moves: bool
    lag: float
    fade: float
    fade_tau: float
    heat: float
    friction: float


def motion(
    effects: Iterable[Effect], sliding_friction: float | None = None, heat: float = 0.0
) -> MotionTerms:
    """Collect motion terms, states and cap of all effects.

    Args:
        effects: validated here.
        sliding_friction: μ_s of `[braking]`; caps the force as locked wheels do.
        heat: brake heat q at the stop command [J/kg].

    Raises:
        ParameterError: also if an effect is given twice that may be there once.
    """
    sums = {name: [0.0] * len(LAWS[name].parameters) for name in MOTION_LAWS}
    seen: set[str] = set()
    lag, fade, fade_tau = 0.0, 0.0, 1.0
    friction = math.inf if sliding_friction is None else sliding_friction
    for effect in effects:
        values = [float(value) for value in validate(effect).values()]
        law = LAWS[effect.name]
        if law.once and effect.name in seen:
            raise ParameterError("name", f"{effect.name} at most once")
        seen.add(effect.name)
        match law.enters:
            case Enters.MOTION:
                sums[effect.name] = [a + b for a, b in zip(sums[effect.name], values, strict=True)]
            case Enters.LAG:
                lag = values[0]
            case Enters.FADE:
                fade, fade_tau = values
            case Enters.CAP:
                friction = min(friction, values[0])
            case _:
                pass
    flat = tuple(value for values in sums.values() for value in values)
    return MotionTerms(flat, any(flat), lag, fade, max(fade_tau, 1e-3), heat, friction)


NO_MOTION = motion(())
"""Nothing acts on the motion."""


def motion_deceleration(
    speed: Elementwise, curvature: Elementwise, yaw: Elementwise, terms: MotionTerms
) -> Elementwise:
    """Deceleration by all motion laws [m/s²]; elementwise.

    Args:
        speed: [m/s]. curvature: [1/m]. yaw: [rad]. terms: of :func:`motion`.
    """
    total = 0.0 * speed
    for law, values in _acting(terms.values):
        total = total + law.law(speed, curvature, yaw, *values)
    return total


@lru_cache(maxsize=64)
def _acting(values: tuple[float, ...]) -> tuple[tuple[EffectLaw, tuple[float, ...]], ...]:
    """Motion laws with their parts of :attr:`MotionTerms.values`, without those of zeros alone."""
    rest, laws = iter(values), [LAWS[name] for name in MOTION_LAWS]
    parts = [(law, tuple(islice(rest, len(law.parameters)))) for law in laws]
    return tuple((law, part) for law, part in parts if any(part))


def ground_term(effects: Iterable[Effect], place: Place) -> Elementwise:
    """Sum of the ground terms of F_b/W; elementwise in the place.

    Args:
        effects: validated here; those without a ground term are ignored, and lasting changes
            contribute only their addition.
        place: [rad], [m], [s].
    """
    total = 0.0 * place.grade
    for effect in effects:
        law = law_of(effect)
        if law.enters is Enters.GROUND:
            total = total + law.law(place, *validate(effect).values())
        elif law.enters is Enters.LASTING:
            total = total + validate(effect)["delta"]
    return total


def has_ground_term(effect: Effect) -> bool:
    """Whether :func:`ground_term` may add anything for an effect."""
    return law_of(effect).enters in (Enters.GROUND, Enters.LASTING)


def force_scale(effects: Iterable[Effect]) -> float:
    """Product of the scales of all lasting changes."""
    lasting = [e for e in effects if law_of(e).enters is Enters.LASTING]
    return math.prod(validate(e)["scale"] for e in lasting)


def up_to_run(effects: Iterable[Effect], run: int) -> tuple[Effect, ...]:
    """Those that act in a run of the log in which they were found, the first being 0.

    Lasting changes are not there before their own run.
    """
    return tuple(
        e
        for e in effects
        if law_of(e).enters is not Enters.LASTING or validate(e).get("run", 0.0) <= run
    )


def crest_share(effects: Iterable[Effect]) -> float | None:
    """Share k of the load lost over a crest that the force loses as well; None: no such effect.

    With k = 0 it is the loads only that suffer.
    """
    crests = [e for e in effects if law_of(e).enters is Enters.CREST]
    return sum(validate(e)["k"] for e in crests) if crests else None
