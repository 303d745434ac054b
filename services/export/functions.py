"""Laws of one model as CasADi functions, for other solvers and controllers.

They are the laws of :mod:`slopewise.models.laws` themselves, called with symbols, so there is no
second writing of any formula; a stop on an even slope is that of
:mod:`slopewise.services.export.even_slope`. What a stop along changing ground is, is left to the
user's integration.
"""

from __future__ import annotations

import contextlib
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, reduce
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Place
from slopewise.models.errors import ParameterError
from slopewise.models.laws import braking, wheel_loads
from slopewise.models.parameters import Model
from slopewise.models.stop_promise import promised
from slopewise.planner.ground.uncertainty import QUANTILE
from slopewise.services.export.even_slope import EvenSlope, choose
from slopewise.services.export.identifier import letters_of
from slopewise.services.io.files import write_atomic

_SPEED, _GRADE = ("speed", "m/s"), ("grade", "rad, uphill positive")
_ROLL = ("roll", "rad, left side up positive")
_GROUND = ("ground_force", "1, of ground_force(); 0 without effects")


@dataclass(frozen=True, slots=True)
class ModelFunction:
    """One function."""

    function: Any  # CasADi function
    inputs: tuple[tuple[str, str], ...]  # names with units
    output: tuple[str, str]  # name and unit
    meaning: str
    evaluate: Callable[..., Any]  # the same by numpy, of arrays in the order of the inputs

    @property
    def name(self) -> str:
        """As callers know it."""
        return str(self.function.name())


def functions_of(model: Model) -> list[ModelFunction]:
    """All functions of a model; with several surfaces those of each, its name behind an underscore.

    Derivatives of each are functions called ``d_…``, a row with one entry an input. Stop distances
    that the file promises are those at plans by default.
    """
    model = promised(model, QUANTILE, as_mean=True)
    with contextlib.suppress(AttributeError):
        ca.GlobalOptions.setNumpyMode(-1)  # symbols in, symbols out
    _check_surfaces(list(model.braking.terrain))
    functions = []
    for surface in ("", *model.braking.terrain):
        functions += _of_surface(model, surface)
    vehicle, terms = model.vehicle, registry.motion(model.effect)
    axles = vehicle.wheelbase, vehicle.cg_x, vehicle.cg_z
    wide = vehicle.track_width, vehicle.cg_z
    slowing = ("deceleration", "m/s^2, positive while slowing")
    lateral = ("lateral_accel", "m/s^2, left positive")
    for part, accel, law, sizes in (
        ("front axle", slowing, wheel_loads.front_load_share, axles),
        ("rear axle", slowing, wheel_loads.rear_load_share, axles),
        ("left side", lateral, wheel_loads.left_load_share, wide),
        ("right side", lateral, wheel_loads.right_load_share, wide),
    ):
        functions.append(
            _model_function(
                law.__name__,
                (_GRADE, _ROLL, accel),
                ("share", "1, of the level static load"),
                f"load of the {part}",
                lambda g, r, a, law=law, sizes=sizes: law(g, r, a, *sizes),
            )
        )
    functions.append(
        _model_function(
            "motion_deceleration",
            (_SPEED, ("curvature", "1/m"), ("yaw", "rad")),
            ("deceleration", "m/s^2"),
            "what drag and other effects on the motion add to the deceleration",
            lambda v, k, yaw: registry.motion_deceleration(v, k, yaw, terms) + 0.0 * (k + yaw),
        )
    )
    return functions


def _check_surfaces(names: list[str]) -> None:
    """ParameterError if functions of two surfaces would have one name, or none."""
    suffixes = {letters_of(name) for name in names}
    if len(suffixes) < len(names) or "" in suffixes:
        expected = "names that differ in letters and digits of ASCII, for functions"
        raise ParameterError("braking.terrain", f"{expected}, got {', '.join(names)}")


def _of_surface(model: Model, surface: str) -> list[ModelFunction]:
    end = f"_{letters_of(surface)}" if surface else ""
    on = f" on {surface}" if surface else ""
    # A surface that may turn out to be in another state counts as the worse of both.
    names = (surface, *model.braking.states_of(surface))
    slopes = [EvenSlope(model, model.braking.on(name)) for name in names]

    def worst(pick: Callable[..., Any], law: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *at: reduce(pick, (law(slope, *at) for slope in slopes))

    def decelerating(force: Callable[..., Any]) -> Callable[..., Any]:
        return lambda v, grade, extra: braking.deceleration(force(v, grade, extra), grade)

    trained = worst(operator.mul, EvenSlope.trained)
    weakest_force = worst(np.fmin, EvenSlope.force)
    strongest_force = worst(np.fmax, partial(EvenSlope.force, upper=True))

    def ratio(speed: Any, grade: Any, extra: Any) -> Any:
        return choose(trained(grade), weakest_force(speed, grade, extra), 0.0)

    state, here = (_SPEED, _GRADE, _GROUND), f"{on}, straight along a constant grade"
    metres = ("distance", "m")
    to_clear = (metres, _GRADE, _GROUND)
    force, decel, speed_of = ("force_ratio", "1"), ("deceleration", "m/s^2"), ("speed", "m/s")
    weakest = f"least F_b/W of full, cold brakes{on}; 0 on grades that were not trained"
    upper_end = f"most of full brakes{on}: for the loads of axles"
    from_command = f"from command to rest{here}; infinite where no stop is known"
    within = f"stops within a distance{here}; 0 where nothing may drive"
    functions = (
        ("force_ratio", state, force, weakest, ratio),
        ("deceleration", state, decel, f"least of full, cold brakes{on}", decelerating(ratio)),
        ("max_deceleration", state, decel, upper_end, decelerating(strongest_force)),
        ("stopping_distance", state, metres, from_command, worst(np.fmax, EvenSlope.distance)),
        ("speed_bound", to_clear, speed_of, within, worst(np.fmin, EvenSlope.speed_bound)),
    )
    return [
        *(
            _model_function(f"{name}{end}", inputs, output, meaning, law)
            for name, inputs, output, meaning, law in functions
        ),
        _ground_force(model, end, on),
    ]


def _ground_force(model: Model, end: str, on: str) -> ModelFunction:
    """With the time of the session as an input where an effect changes with it."""
    inputs = [_GRADE, _ROLL, ("x", "m"), ("y", "m"), ("yaw", "rad")]
    depends_on = {name for effect in model.effect for name in registry.law_of(effect).depends_on}
    if "session_time" in depends_on:
        inputs.append(("session_time", "s, since the session began"))

    def term(grade: Any, roll: Any, x: Any, y: Any, yaw: Any, time: Any = 0.0) -> Any:
        here = Place(grade, roll, x, y, yaw, time)
        force = registry.ground_term(model.effect, here) + 0.0 * (roll + x + y + yaw + time)
        if "place" not in depends_on:
            return force
        # A position that is not known may be on a weak patch: no number, and no stop is known.
        return choose(np.fabs(x) + np.fabs(y) < np.inf, force, np.nan)

    meaning = f"what effects of the place add to F_b/W{on}"
    return _model_function(f"ground_force{end}", tuple(inputs), ("force_ratio", "1"), meaning, term)


def _model_function(
    name: str,
    inputs: tuple[tuple[str, str], ...],
    output: tuple[str, str],
    meaning: str,
    law: Callable[..., Any],
) -> ModelFunction:
    symbols = [ca.SX.sym(symbol) for symbol, _ in inputs]
    value = ca.SX(law(*symbols))
    function = ca.Function(name, symbols, [value], [symbol for symbol, _ in inputs], [output[0]])
    return ModelFunction(function, inputs, output, meaning, law)


def derivative_of(model_function: ModelFunction) -> Any:
    """The function ``d_…``: derivatives by each input, (1, inputs)."""
    symbols = [ca.SX.sym(symbol) for symbol, _ in model_function.inputs]
    value = model_function.function(*symbols)
    row = ca.horzcat(*(ca.jacobian(value, symbol) for symbol in symbols))
    return ca.Function(
        f"d_{model_function.name}",
        symbols,
        [row],
        [s for s, _ in model_function.inputs],
        ["derivatives"],
    )


def write_functions(model_functions: list[ModelFunction], path: Path) -> None:
    """Write all functions and their derivatives into a file of CasADi."""
    # The serialiser knows functions by their addresses: none may be freed before the last is in.
    functions = [f for m in model_functions for f in (m.function, derivative_of(m))]
    out = ca.StringSerializer()
    out.pack(len(functions))
    for function in functions:
        out.pack(function)
    write_atomic(path, out.encode().encode())
