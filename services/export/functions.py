"""Laws of one model as CasADi functions, for people with solvers and controllers of their own.

They are the laws of :mod:`models.laws` themselves, called with symbols, so there is no second
writing of any formula. What a stop along changing ground is, is left to whoever integrates it:
``deceleration`` is all that it takes.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from models.effects import registry
from models.effects.effect_law import Place
from models.laws import braking, wheel_loads
from models.parameters import Braking, Model

_SPEED, _GRADE = ("speed", "m/s"), ("grade", "rad, uphill positive")
_ROLL = ("roll", "rad, left side up positive")
_GROUND = ("ground_force", "1, of ground_force(); 0 without effects")


@dataclass(frozen=True, slots=True)
class ModelFunction:
    """One function.

    Attributes:
        function: of CasADi. inputs: names with units. output: name and unit. words: what it is.
        evaluate: the same by numpy, of arrays in the order of the inputs.
    """

    function: Any
    inputs: tuple[tuple[str, str], ...]
    output: tuple[str, str]
    words: str
    evaluate: Callable[..., Any]

    @property
    def name(self) -> str:
        """As callers know it."""
        return str(self.function.name())


def functions_of(model: Model) -> list[ModelFunction]:
    """All functions of a model; with several surfaces those of each, its name behind an underscore.

    Derivatives of each are functions called ``d_…``, a row with one entry an input.
    """
    with contextlib.suppress(AttributeError):
        ca.GlobalOptions.setNumpyMode(-1)  # symbols in, symbols out
    found = []
    for surface in ("", *model.braking.terrain):
        found += _of_surface(model, model.braking.on(surface), surface)
    vehicle, terms = model.vehicle, registry.motion(model.effect)
    sizes = vehicle.wheelbase, vehicle.cg_x, vehicle.cg_z
    slowing = ("deceleration", "m/s^2, positive while slowing")
    aside = ("lateral_accel", "m/s^2, left positive")
    share = ("share", "1, of the level static load")
    for name, law in (
        ("front_load_share", wheel_loads.front_load_share),
        ("rear_load_share", wheel_loads.rear_load_share),
    ):
        words = f"load of the {name.partition('_')[0]} axle"
        inputs = (_GRADE, _ROLL, slowing)
        found.append(
            _made(name, inputs, share, words, lambda g, r, a, law=law: law(g, r, a, *sizes))
        )
    wide = vehicle.track_width, vehicle.cg_z
    for name, side in (
        ("left_load_share", wheel_loads.left_load_share),
        ("right_load_share", wheel_loads.right_load_share),
    ):
        words = f"load of the {name.partition('_')[0]} side"
        inputs = (_GRADE, _ROLL, aside)
        found.append(
            _made(name, inputs, share, words, lambda g, r, a, law=side: law(g, r, a, *wide))
        )
    found.append(
        _made(
            "motion_deceleration",
            (_SPEED, ("curvature", "1/m"), ("yaw", "rad")), ("deceleration", "m/s^2"),
            "what drag and other effects on the motion add to the deceleration",
            lambda v, k, yaw: registry.motion_deceleration(v, k, yaw, terms) + 0.0 * (k + yaw),
        )
    )  # fmt: skip
    return found


def _of_surface(model: Model, table: Braking, surface: str) -> list[ModelFunction]:
    end = f"_{surface}" if surface else ""
    on = f" on {surface}" if surface else ""
    terms = registry.motion(model.effect, table.sliding_friction)
    scale, dead = registry.force_scale(model.effect), table.dead_time + terms.lag

    def ratio(speed: Any, grade: Any, extra: Any) -> Any:
        v = np.fmax(speed, table.speed_range[0])
        force = braking.force_ratio(grade, v, table.m_m, table.b_m, table.m_b, table.b_b)
        if table.uphill is not None:
            up = braking.force_ratio(
                grade, v, table.uphill.m_m, table.uphill.b_m, table.m_b, table.b_b
            )
            rises = 0.5 * (1.0 + np.sign(grade))
            force = rises * up + (1.0 - rises) * force
        held = model.terrain.rolling_while_braking
        force = scale * force
        force = braking.force_ratio_at_level(force, held, table.share_at()) + extra
        return np.fmin(force, terms.friction * np.cos(grade)) if terms.friction < 1e6 else force

    def slowing(speed: Any, grade: Any, extra: Any) -> Any:
        return braking.deceleration(ratio(speed, grade, extra), grade)

    def distance(speed: Any, grade: Any, extra: Any) -> Any:
        decel = slowing(speed, grade, extra)
        return braking.stopping_distance(speed, decel, dead, table.distance_offset)

    def bound(clear: Any, grade: Any, extra: Any) -> Any:
        # F_b/W is linear in the speed at onset: the weaker end is weaker than all between.
        ends = [slowing(v, grade, extra) + 0.0 * clear for v in table.speed_range]
        decel = np.fmin(*ends)
        return braking.speed_of_stopping_distance(clear, decel, dead, table.distance_offset)

    state, here = (_SPEED, _GRADE, _GROUND), f"{on}, constant grade"
    return [
        _made(f"force_ratio{end}", state, ("force_ratio", "1"), f"F_b/W{on}", ratio),
        _made(f"deceleration{end}", state, ("deceleration", "m/s^2"), f"full brakes{on}", slowing),
        _made(f"stopping_distance{end}", state, ("distance", "m"),
              f"from command to rest{here}", distance),
        _made(f"speed_bound{end}", (("distance", "m"), _GRADE, _GROUND), ("speed", "m/s"),
              f"highest that stops within a distance{here}", bound),
        _made(f"ground_force{end}",
              (_GRADE, _ROLL, ("x", "m"), ("y", "m"), ("yaw", "rad")), ("force_ratio", "1"),
              f"what effects of the place add to F_b/W{on}",
              lambda g, r, x, y, yaw: registry.ground_term(
                  model.effect, Place(g, r, x, y, yaw, 0.0)) + 0.0 * (r + x + y + yaw)),
    ]  # fmt: skip


def _made(
    name: str, inputs: tuple[tuple[str, str], ...], output: tuple[str, str], words: str,
    law: Callable[..., Any],
) -> ModelFunction:  # fmt: skip
    symbols = [ca.SX.sym(symbol) for symbol, _ in inputs]
    value = ca.SX(law(*symbols))
    function = ca.Function(name, symbols, [value], [symbol for symbol, _ in inputs], [output[0]])
    return ModelFunction(function, inputs, output, words, law)


def derivative_of(one: ModelFunction) -> Any:
    """The function ``d_…``: derivatives by each input, (1, inputs)."""
    symbols = [ca.SX.sym(symbol) for symbol, _ in one.inputs]
    value = one.function(*symbols)
    row = ca.horzcat(*(ca.jacobian(value, symbol) for symbol in symbols))
    return ca.Function(f"d_{one.name}", symbols, [row], [s for s, _ in one.inputs], ["derivatives"])


def write_functions(made: list[ModelFunction], path: Path) -> None:
    """All functions and their derivatives into a file of CasADi's own."""
    # The serialiser knows functions by their addresses: none may be freed before the last is in.
    functions = [f for one in made for f in (one.function, derivative_of(one))]
    out = ca.FileSerializer(str(path))
    out.pack(len(functions))
    for function in functions:
        out.pack(function)


def read_functions(path: Path) -> dict[str, Any]:
    """What :func:`write_functions` wrote, by name."""
    given = ca.FileDeserializer(str(path))
    functions = [given.unpack() for _ in range(given.unpack())]
    return {str(function.name()): function for function in functions}
