"""C code of a model by CasADi's generator; a header with units, and vectors to test by."""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from typing import Any

import casadi as ca
import numpy as np

from slopewise.models.parameters import Model
from slopewise.services.export.functions import ModelFunction, derivative_of
from slopewise.services.export.identifier import identifier
from slopewise.services.io.files import fault, write_atomic

_VECTORS = 8  # Test vectors per function [1]
_CLOSING = '} /* extern "C" */\n#endif\n'
_UNUSED = """#ifdef __GNUC__ /* interfaces of CasADi have arguments that few functions use */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
"""
_RANGES = {
    "speed": (0.2, 4.0),
    "grade": (-0.2, 0.2),
    "roll": (-0.2, 0.2),
    "distance": (0.2, 3.5),
    "deceleration": (0.0, 4.0),
    "lateral_accel": (-2.0, 2.0),
    "curvature": (-0.3, 0.3),
    "yaw": (-3.0, 3.0),
    "x": (-20.0, 20.0),
    "y": (-20.0, 20.0),
    "ground_force": (0.0, 0.05),
    "session_time": (0.0, 3600.0),
}


def sample_inputs(function: ModelFunction, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points (count, inputs) within usual ranges, SI."""
    return np.column_stack([rng.uniform(*_RANGES[name], count) for name, _ in function.inputs])


def write_c(model: Model, functions: list[ModelFunction], folder: Path) -> list[Path]:
    """Write NAME.c, NAME.h (CasADi's), and NAME_model.h: units, and vectors to test by."""
    folder.mkdir(parents=True, exist_ok=True)
    name = identifier(model.name)
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": True, "verbose": False})
    for function in functions:
        generator.add(function.function)
        generator.add(derivative_of(function))
    with TemporaryDirectory() as scratch:
        generator.generate(f"{scratch}/")
        code = {part: (Path(scratch) / part).read_text() for part in (f"{name}.c", f"{name}.h")}
    for part, text in code.items():
        if not text.endswith(_CLOSING):  # CasADi ignores that a disk is full
            raise fault(folder / part, "", f"expected room for a copy in {gettempdir()}")
    code[f"{name}.c"] = _UNUSED + code[f"{name}.c"]
    code[f"{name}_model.h"] = _header(model, name, functions)
    for part, text in code.items():
        write_atomic(folder / part, text.encode())
    return [folder / part for part in code]


def _header(model: Model, name: str, functions: list[ModelFunction]) -> str:
    guard = f"{name.upper()}_MODEL_H"
    lines = [
        f"/* The model {_in_comment(repr(model.name))}: what {name}.h takes and gives. SI units.",
        " *",
        " * Call: int f(const double** arg, double** res, long long* iw, double* w, int mem);",
        " * arg[i] points to input i, res[0] to the output; f_work() says how long iw and w are.",
        " * d_f gives the derivatives of f by its inputs, in their order. */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "#include <math.h>",
        "",
    ]
    rng = np.random.default_rng(0)
    for function in functions:
        inputs = ", ".join(f"{i} [{unit}]" for i, unit in function.inputs)
        lines.append(
            f"/* {function.name}({inputs}) -> {function.output[0]} [{function.output[1]}]: "
            f"{_in_comment(function.meaning)} */"
        )
        points = sample_inputs(function, _VECTORS, rng)
        values = np.array([float(function.function(*point)) for point in points])
        lines += [
            _array(f"test_{function.name}_in", points, f"[{len(points)}][{len(function.inputs)}]"),
            _array(f"test_{function.name}_out", values[:, None], f"[{len(points)}]"),
            "",
        ]
    return "\n".join([*lines, f"#endif /* {guard} */", ""])


def _in_comment(text: str) -> str:
    return text.replace("*/", "* /").replace("\n", " ")


def _array(name: str, rows: Any, shape: str) -> str:
    is_flat = rows.shape[1] == 1
    body = [", ".join(_number(float(v)) for v in row) for row in rows]
    inside = ", ".join(body if is_flat else (f"{{{row}}}" for row in body))
    return f"static const double {name}{shape} = {{{inside}}};"


def _number(value: float) -> str:
    return "INFINITY" if value == math.inf else f"{value:.17g}"
