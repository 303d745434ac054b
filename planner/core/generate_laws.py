"""Writes `generated/laws.hpp`: laws of `models`, from their one Python source, in C++.

`python planner/core/generate_laws.py` writes it again, in an environment with CasADi; a test
compares. A law is called with symbols, and what CasADi recorded is written as one function.
"""

from __future__ import annotations

import inspect
import re
import textwrap
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi

from slopewise.models.effects.registry import LAWS, MOTION_LAWS
from slopewise.models.laws import friction_ellipse, holding, slip_track, wheel_loads

HEADER = Path(__file__).parent / "generated" / "laws.hpp"

_LAWS: tuple[Callable[..., Any], ...] = (
    wheel_loads.front_load_share,
    wheel_loads.rear_load_share,
    wheel_loads.left_load_share,
    wheel_loads.right_load_share,
    friction_ellipse.side_force_ratio,
    friction_ellipse.normal_ratio,
    friction_ellipse.braking_left,
    slip_track.outer_wheel_speed_ratio,
    holding.brakes_hold,
    holding.friction_holds,
)
_STATE = ("speed", "curvature", "yaw")
"""What every motion law is given before its own parameters."""

_WRITTEN = {
    casadi.OP_ADD: "({0} + {1})",
    casadi.OP_SUB: "({0} - {1})",
    casadi.OP_MUL: "({0} * {1})",
    casadi.OP_DIV: "({0} / {1})",
    casadi.OP_NEG: "(-{0})",
    casadi.OP_SIN: "std::sin({0})",
    casadi.OP_COS: "std::cos({0})",
    casadi.OP_SQRT: "std::sqrt({0})",
    casadi.OP_FABS: "std::fabs({0})",
    casadi.OP_SIGN: "sign({0})",
    casadi.OP_SQ: "square({0})",
    casadi.OP_TWICE: "(2.0 * {0})",
    casadi.OP_FMIN: "std::fmin({0}, {1})",
    casadi.OP_FMAX: "std::fmax({0}, {1})",
}
"""How an operation is written. Where CasADi has another, `operations` says so."""

_START = """// Laws of models/laws and of motion effects. Written by generate_laws.py: do not edit.
// Arguments, units and sources are those of the Python functions of the same names.
#pragma once

#include <cmath>

namespace slopewise::laws {

[[nodiscard]] constexpr double square(double x) noexcept { return x * x; }
[[nodiscard]] constexpr double sign(double x) noexcept {
  return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : x);
}
"""


def header() -> str:
    """The whole file."""
    if hasattr(casadi.GlobalOptions, "setNumpyMode"):
        casadi.GlobalOptions.setNumpyMode(-1)  # symbols in, symbols out
    functions = [_function(law.__name__, law, tuple(_names_of(law))) for law in _LAWS]
    total, first = [], 0
    for name in MOTION_LAWS:
        parameters = tuple(LAWS[name].parameters)
        functions.append(_function(name, LAWS[name].law, (*_STATE, *parameters)))
        values = [f"values[{first + k}]" for k in range(len(parameters))]
        total.append(f"{name}({', '.join((*_STATE, *values))})")
        first += len(parameters)
    sums = " +\n         ".join(total)
    functions.append(
        f"inline constexpr int motion_value_count = {first};\n"
        f'inline constexpr const char* motion_laws = "{" ".join(MOTION_LAWS)}";\n\n'
        "// Sum of all motion laws [m/s²]; (motion_value_count,) values, 0 of absent effects.\n"
        "[[nodiscard]] inline double motion_deceleration(double speed, double curvature, "
        f"double yaw,\n{' ' * 48}const double* values) noexcept {{\n  return {sums};\n}}\n"
    )
    return "\n".join((_START, *functions, "}  // namespace slopewise::laws\n"))


def _names_of(law: Callable[..., Any]) -> list[str]:
    return list(inspect.signature(law).parameters)


def _function(name: str, law: Callable[..., Any], arguments: tuple[str, ...]) -> str:
    symbols = [casadi.SX.sym(argument) for argument in arguments]
    recorded = casadi.Function(name, symbols, [law(*symbols)])
    lines = operations(recorded, arguments)
    used = " ".join(lines)
    parameters = tuple(
        f"double\u00a0{argument}" if re.search(rf"\b{argument}\b", used) else "double"
        for argument in arguments
    )
    head = _wrapped(f"[[nodiscard]] inline double {name}(", parameters, ")\u00a0noexcept\u00a0{")
    body = "\n".join(
        textwrap.fill(line, 98, initial_indent="  ", subsequent_indent="      ") for line in lines
    )
    return f"{head}\n{body}\n}}\n".replace("\u00a0", " ")


def operations(recorded: casadi.Function, arguments: tuple[str, ...]) -> list[str]:
    """Statements of a recorded function; what is used once stands where it is used.

    Raises:
        ValueError: it has an operation that is not written here.
    """
    steps = range(recorded.n_instructions())
    # A place of the working memory serves many values: each is known by the step that made it.
    step_of: dict[int, int] = {}
    operands: dict[int, list[int]] = {}
    uses: Counter[int] = Counter()
    for k in steps:
        kind = recorded.instruction_id(k)
        places = [] if kind in (casadi.OP_CONST, casadi.OP_INPUT) else recorded.instruction_input(k)
        operands[k] = [step_of[place] for place in places]
        uses.update(operands[k])
        if kind != casadi.OP_OUTPUT:
            step_of[recorded.instruction_output(k)[0]] = k
    text: dict[int, str] = {}
    lines = []
    for k in steps:
        kind = recorded.instruction_id(k)
        if kind == casadi.OP_INPUT:
            text[k] = arguments[recorded.instruction_input(k)[0]]
        elif kind == casadi.OP_CONST:
            text[k] = repr(float(recorded.instruction_constant(k)))
        elif kind == casadi.OP_OUTPUT:
            lines.append(f"return {_bare(text[operands[k][0]])};")
        elif kind in _WRITTEN:
            parts = [text[operand] for operand in operands[k]]
            if not _WRITTEN[kind].startswith("("):
                parts = [_bare(part) for part in parts]
            text[k] = _WRITTEN[kind].format(*parts)
            if uses[k] > 1:
                lines.append(f"const double part{len(lines)} = {_bare(text[k])};")
                text[k] = f"part{len(lines) - 1}"
        else:
            raise ValueError(f"{recorded.name()}: CasADi's operation {kind} has no C++ here")
    return lines


def _bare(text: str) -> str:
    """Without the parentheses around the whole."""
    return text[1:-1] if text.startswith("(") else text


def _wrapped(start: str, items: tuple[str, ...], end: str) -> str:
    """A call or a head, folded as the rest of the core is."""
    return textwrap.fill(
        start + ", ".join(items) + end,
        width=100,
        subsequent_indent=" " * len(start),
        break_long_words=False,
    )


if __name__ == "__main__":
    HEADER.write_text(header())
