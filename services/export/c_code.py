"""C code of a model by CasADi's generator; a header with units, and vectors to test by."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from slopewise.models.parameters import Model
from slopewise.services.export.functions import ModelFunction, derivative_of
from slopewise.services.io.files import write_atomic

_VECTORS = 8
_RANGES = {
    "speed": (0.2, 4.0),
    "grade": (-0.2, 0.2),
    "roll": (-0.2, 0.2),
    "distance": (1.0, 20.0),
    "deceleration": (0.0, 4.0),
    "lateral_accel": (-2.0, 2.0),
    "curvature": (-0.3, 0.3),
    "yaw": (-3.0, 3.0),
    "x": (-20.0, 20.0),
    "y": (-20.0, 20.0),
    "ground_force": (0.0, 0.05),
    "session_time": (0.0, 3600.0),
}


def sample_inputs(one: ModelFunction, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points (count, inputs) within usual ranges, SI."""
    return np.column_stack([rng.uniform(*_RANGES[name], count) for name, _ in one.inputs])


def write_c(model: Model, made: list[ModelFunction], folder: Path) -> list[Path]:
    """Write NAME.c, NAME.h (CasADi's), and NAME_model.h: units, and vectors to test by.

    Args:
        model: that functions are of. made: by
        :func:`slopewise.services.export.functions.functions_of`.
        folder: made if it is not there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    name = re.sub(r"\W", "_", model.name) or "model"
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": True, "verbose": False})
    for one in made:
        generator.add(one.function)
        generator.add(derivative_of(one))
    generator.generate(f"{folder}/")
    header = folder / f"{name}_model.h"
    write_atomic(header, _header(model, name, made).encode())
    return [folder / f"{name}.c", folder / f"{name}.h", header]


def _header(model: Model, name: str, made: list[ModelFunction]) -> str:
    guard = f"{name.upper()}_MODEL_H"
    lines = [
        f"/* The model {model.name!r}: what functions of {name}.h take and give. SI units.",
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
    for one in made:
        inputs = ", ".join(f"{i} [{unit}]" for i, unit in one.inputs)
        lines.append(
            f"/* {one.name}({inputs}) -> {one.output[0]} [{one.output[1]}]: {one.words} */"
        )
        points = sample_inputs(one, _VECTORS, rng)
        values = np.array([float(one.function(*point)) for point in points])
        lines += [
            _array(f"test_{one.name}_in", points, f"[{len(points)}][{len(one.inputs)}]"),
            _array(f"test_{one.name}_out", values[:, None], f"[{len(points)}]"),
            "",
        ]
    return "\n".join([*lines, f"#endif /* {guard} */", ""])


def _array(name: str, rows: Any, shape: str) -> str:
    one = rows.shape[1] == 1
    body = [", ".join(_number(float(v)) for v in row) for row in rows]
    inside = ", ".join(body if one else (f"{{{row}}}" for row in body))
    return f"static const double {name}{shape} = {{{inside}}};"


def _number(value: float) -> str:
    return "INFINITY" if value == math.inf else f"{value:.17g}"
