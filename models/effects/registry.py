"""Named effects that the base braking model leaves out, as terms that add up.

The base is Braking (7)–(8): a force fixed by grade and by the speed at brake onset, after a pure
dead time. An effect enters in one of five ways, and planner and simulation use the same ones:

=====================  ============================================================
ground term            F_b/W += term(grade, roll, x, y, yaw, session time)
scale                  F_b/W *= scale
motion term            a += term(speed, curvature, yaw), with a the deceleration
state or cap           the force builds up, fades with heat, or is capped by friction
crest                  all of it falls with the load that a crest takes: see `models.laws.crest`
=====================  ============================================================

Of the last, in this order: pressure builds up (lag), hot pads make less of it (fade), and friction
on the ground caps what is left.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from models.errors import ParameterError
from models.parameters import Effect
from models.quantity import GRAVITY

_ANY = (-math.inf, math.inf)
_POSITIVE = (0.0, math.inf)


@dataclass(frozen=True, slots=True)
class EffectLaw:
    """What is known of one effect before any data.

    Attributes:
        missing: what the base model leaves out, in words.
        parameters: name -> (unit, lowest, highest); bounds are physical signs and sizes.
        optional: parameters that may be left out, with their value then.
    """

    missing: str
    parameters: dict[str, tuple[str, float, float]]
    optional: dict[str, float]


def _law(
    missing: str,
    parameters: dict[str, tuple[str, tuple[float, float]]],
    optional: dict[str, float] | None = None,
) -> EffectLaw:
    flat = {name: (unit, low, high) for name, (unit, (low, high)) in parameters.items()}
    return EffectLaw(missing, flat, optional or {})


LAWS: dict[str, EffectLaw] = {
    "aerodynamic_drag": _law("drag growing with v(t)²", {"c": ("1/m", _POSITIVE)}),
    "headwind": _law(
        "drag relative to the wind",
        {
            "c": ("1/m", _POSITIVE),
            "wind": ("m/s", _ANY),
            "direction": ("rad", _ANY),
        },
    ),
    "viscous_resistance": _law("loss growing with v(t)", {"c": ("s/m", _POSITIVE)}),
    "brake_lag": _law("force builds up gradually after the dead time", {"tau": ("s", _POSITIVE)}),
    "brake_fade": _law(
        "force falls as the brake heats and recovers as it cools",
        {"k": ("kg/J", _POSITIVE), "tau": ("s", _POSITIVE)},
    ),
    "wheel_lockup": _law("friction caps the force", {"mu": ("1", _POSITIVE)}),
    "grade_asymmetry": _law("another slope coefficient uphill", {"k": ("1/rad", _ANY)}),
    "grade_nonlinearity": _law("slope dependence bends away", {"k": ("1/rad²", _ANY)}),
    "crest_unloading": _law("force falls with the load over a crest", {"k": ("1", _POSITIVE)}),
    "cross_slope": _law("force changes with roll", {"k": ("1/rad", _ANY)}),
    "turning_resistance": _law("turning costs force", {"k": ("s/rad", _POSITIVE)}),
    "surface_patch": _law(
        "another surface in one place",
        {
            "delta": ("1", _ANY),
            "x": ("m", _ANY),
            "y": ("m", _ANY),
            "radius": ("m", _POSITIVE),
        },
    ),
    "directional_surface": _law(
        "resistance depends on heading", {"k": ("1", _ANY), "direction": ("rad", _ANY)}
    ),
    "step_change": _law(
        "one lasting change during the log",
        {"scale": ("1", _POSITIVE), "delta": ("1", _ANY), "run": ("1", _POSITIVE)},
        {"scale": 1.0, "delta": 0.0, "run": 0.0},
    ),
    "session_drift": _law("slow change with time", {"k": ("1/s", _ANY)}),
}
"""Every effect by name. Lasting changes (`step_change`) hold for all that is planned after them."""


BENT_AT_LEVEL = ("grade_asymmetry", "cross_slope")
"""Ground terms that are zero on level ground and have a kink there."""


def validate(effect: Effect) -> dict[str, float]:
    """All parameters of an effect, optional ones filled in.

    Raises:
        ParameterError: unknown effect or parameter, or a value outside its physical bounds.
    """
    law = LAWS.get(effect.name)
    if law is None:
        raise ParameterError("name", f"one of {', '.join(LAWS)}; got {effect.name!r}")
    for name in effect.parameters:
        if name not in law.parameters:
            raise ParameterError(
                f"parameters.{name}",
                f"only {', '.join(law.parameters)} as parameters of {effect.name}",
            )
    values = law.optional | dict(effect.parameters)
    for name, (unit, low, high) in law.parameters.items():
        value = values.get(name)
        if value is None:
            raise ParameterError(f"parameters.{name}", f"a number [{unit}] for {effect.name}")
        if not (math.isfinite(value) and low <= value <= high):
            raise ParameterError(
                f"parameters.{name}", f"a number in [{low:g}, {high:g}] [{unit}], got {value!r}"
            )
    return values


class Motion(NamedTuple):
    """Motion terms, states and cap in the form that an integrator wants. Zero or inf is absent.

    Attributes:
        drag: c of a += c v² [1/m].
        viscous: c of a += g c v [s/m].
        turning: k of a += g k |κ| v [s/rad].
        wind_drag: c of a += c (|u| u − v²), u = v + wind cos(yaw − wind_direction) [1/m].
        wind, wind_direction: headwind [m/s], direction the vehicle heads when it meets it [rad].
        lag: time constant τ of df/dt = (F − f)/τ, f = 0 at onset [s].
        fade: k of F /(1 + k q) [kg/J]; dq/dt = braking power per mass − q/fade_tau.
        fade_tau: cooling time constant [s].
        heat: q at the stop command [J/kg].
        friction: cap of F_b/W on level ground.
    """

    drag: float
    viscous: float
    turning: float
    wind_drag: float
    wind: float
    wind_direction: float
    lag: float
    fade: float
    fade_tau: float
    heat: float
    friction: float


def motion(
    effects: Iterable[Effect], sliding_friction: float | None = None, heat: float = 0.0
) -> Motion:
    """Collect motion terms, states and cap of all effects.

    Args:
        effects: validated here.
        sliding_friction: μ_s of `[braking]`; caps the force as `wheel_lockup` does.
        heat: brake heat q at the stop command [J/kg].

    Raises:
        ParameterError: also if a state effect or the wind is given twice.
    """
    sums = dict.fromkeys(("aerodynamic_drag", "viscous_resistance", "turning_resistance"), 0.0)
    once: dict[str, dict[str, float]] = {}
    friction = math.inf if sliding_friction is None else sliding_friction
    for effect in effects:
        values = validate(effect)
        if effect.name in sums:
            sums[effect.name] += values["k" if effect.name == "turning_resistance" else "c"]
        elif effect.name == "wheel_lockup":
            friction = min(friction, values["mu"])
        elif effect.name in ("headwind", "brake_lag", "brake_fade"):
            if effect.name in once:
                raise ParameterError("name", f"{effect.name} at most once")
            once[effect.name] = values
    wind = once.get("headwind", {"c": 0.0, "wind": 0.0, "direction": 0.0})
    fade = once.get("brake_fade", {"k": 0.0, "tau": 1.0})
    return Motion(
        drag=sums["aerodynamic_drag"],
        viscous=sums["viscous_resistance"],
        turning=sums["turning_resistance"],
        wind_drag=wind["c"],
        wind=wind["wind"],
        wind_direction=wind["direction"],
        lag=once.get("brake_lag", {"tau": 0.0})["tau"],
        fade=fade["k"],
        fade_tau=max(fade["tau"], 1e-3),
        heat=heat,
        friction=friction,
    )


def ground_term(
    effects: Iterable[Effect],
    grade: Any,
    roll: Any,
    x: Any,
    y: Any,
    yaw: Any,
    session_time: Any = 0.0,
) -> Any:
    """Sum of the ground terms of F_b/W; elementwise over its array arguments.

    Args:
        effects: validated here.
        grade, roll, yaw: [rad]. x, y: map coordinates [m].
        session_time: time since the session began [s], for `session_drift`.
    """
    total = 0.0 * grade
    for effect in effects:
        p = validate(effect)
        match effect.name:
            case "grade_asymmetry":
                total = total + p["k"] * np.fmax(grade, 0.0)
            case "grade_nonlinearity":
                total = total + p["k"] * grade * np.fabs(grade)
            case "cross_slope":
                total = total + p["k"] * np.fabs(roll)
            case "surface_patch":
                inside = np.hypot(x - p["x"], y - p["y"]) <= p["radius"]
                total = total + p["delta"] * inside
            case "directional_surface":
                total = total + p["k"] * np.cos(2.0 * (yaw - p["direction"]))
            case "step_change":
                total = total + p["delta"]
            case "session_drift":
                total = total + p["k"] * session_time
    return total


def force_scale(effects: Iterable[Effect]) -> float:
    """Product of the scales of all lasting changes."""
    return math.prod(validate(e)["scale"] for e in effects if e.name == "step_change")


NO_MOTION = motion(())
"""Nothing acts on the motion."""


def crest_share(effects: Iterable[Effect]) -> float | None:
    """Share k of the load lost over a crest that the force loses as well; None without the effect.

    With k = 0 it is the loads only that suffer.
    """
    shares = [validate(e)["k"] for e in effects if e.name == "crest_unloading"]
    return sum(shares) if shares else None


def motion_deceleration(speed: Any, curvature: Any, yaw: Any, terms: Motion) -> Any:
    """Deceleration by the motion terms [m/s²]; elementwise in speed, curvature [1/m], yaw [rad]."""
    relative = speed + terms.wind * np.cos(yaw - terms.wind_direction)
    wind = terms.wind_drag * (np.fabs(relative) * relative - speed * speed)
    linear = GRAVITY * (terms.viscous + terms.turning * np.fabs(curvature)) * speed
    return linear + terms.drag * speed * speed + wind
