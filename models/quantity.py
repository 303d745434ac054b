"""Physical quantities: the one constant of nature used here, and fields that know unit and range.

A parameter is a dataclass field made by :func:`quantity`. Its metadata carries unit, range and a
sentence, so that validation, error messages and the parameter reference come from one place.
"""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache, partial
from typing import Any, TypeAlias

import numpy as np

from slopewise.models.errors import ParameterError

GRAVITY = 9.80665
"""Standard gravity g [m/s²]."""

MAX_SPEED = 1e3
"""Speed beyond that of any vehicle [m/s]."""

STEEPEST = 0.5 * math.pi
"""Slope of a wall [rad]: no grade or roll is beyond."""

STEEPEST_DRIVEN = 1.0
"""Grade or roll that no wheels hold on [rad]: friction would have to be 1.6."""

_FOREIGN: dict[str, tuple[tuple[str, float], ...]] = {
    "m": (("mm", 1e-3), ("cm", 1e-2), ("in", 0.0254), ("ft", 0.3048)),
    "m/s": (("km/h", 1.0 / 3.6), ("mph", 0.44704), ("mm/s", 1e-3)),
    "m/s²": (("km/h/s", 1.0 / 3.6), ("g", GRAVITY), ("mm/s²", 1e-3)),
    "m/s³": (("mm/s³", 1e-3),),
    "kg": (("t", 1e3), ("lb", 0.45359237), ("g", 1e-3)),
    "s": (("ms", 1e-3), ("min", 60.0)),
    "N": (("kN", 1e3), ("kgf", GRAVITY), ("lbf", 4.448222)),
    "W": (("kW", 1e3), ("hp", 745.7)),
    "rad": (("°", math.pi / 180.0),),
    "rad/s": (("°/s", math.pi / 180.0),),
    "1": (("m/s²", 1.0 / GRAVITY), ("%", 1e-2)),
    "Hz": (("1/min", 1.0 / 60.0),),
    "A": (("mA", 1e-3),),
    "N m/A": (("mN m/A", 1e-3),),
}
"""Units that people write by mistake, and the factor to the unit of the key."""

Matrix: TypeAlias = tuple[tuple[float, ...], ...]
"""Rows of a matrix as a file holds them."""

_REQUIRED = dataclasses.MISSING


def quantity(
    unit: str,
    text: str,
    plausible: tuple[float, float] = (-math.inf, math.inf),
    *,
    default: Any = _REQUIRED,
    above: float = -math.inf,
    at_least: float = -math.inf,
    at_most: float = math.inf,
) -> Any:
    """A dataclass field that holds a physical quantity.

    Args:
        unit: SI unit as shown to users ("kg", "m/s", "1" for dimensionless).
        text: one sentence that says what it is.
        plausible: lowest and highest value that a model file may hold; beyond, it is a mistake,
            mostly of the unit. Values that are computed may lie there.
        default: without it the field is required.
        above: exclusive lower bound.
        at_least: inclusive lower bound.
        at_most: inclusive upper bound.
    """
    metadata = {
        "unit": unit,
        "text": text,
        "above": above,
        "at_least": at_least,
        "at_most": at_most,
        "plausible": plausible,
    }
    if default is _REQUIRED:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


positive = partial(quantity, above=0.0)
non_negative = partial(quantity, at_least=0.0)


def describe_range(metadata: Any) -> str:
    """Text of the allowed range of a quantity, e.g. ``a number > 0 [kg]``."""
    bounds = []
    if metadata["above"] > -math.inf:
        bounds.append(f"> {metadata['above']:g}")
    if metadata["at_least"] > -math.inf:
        bounds.append(f">= {metadata['at_least']:g}")
    if metadata["at_most"] < math.inf:
        bounds.append(f"<= {metadata['at_most']:g}")
    return f"a finite number {' and '.join(bounds)}".rstrip() + f" [{metadata['unit']}]"


def describe_plausible(metadata: Any) -> str:
    """The values that a model file may hold, e.g. ``0.02 … 1.5``; "" where all in range may be."""
    low, high = metadata["plausible"]
    return "" if math.isinf(high) else f"{rounded(low)} … {rounded(high)}"


def validate_quantities(instance: Any) -> None:
    """Check every quantity of a dataclass instance against its range.

    Converts an int to float where a float is declared: kernels are compiled for floats, and an int
    would cause another compilation.

    Raises:
        ParameterError: names the field and what was expected.
    """
    for field in dataclasses.fields(instance):
        if "unit" not in field.metadata:
            continue
        value = getattr(instance, field.name)
        if value is None and field.default is None:
            continue
        metadata = field.metadata
        if not in_range(value, metadata):
            guess = unit_guess(value, metadata["unit"], *metadata["plausible"])
            raise ParameterError(field.name, f"{describe_range(metadata)}, got {value!r}{guess}")
        if "float" in str(field.type):
            object.__setattr__(instance, field.name, float(value))


class Quantities:
    """Base of a dataclass whose quantities have to be in range, and nothing else."""

    __slots__ = ()

    def __post_init__(self) -> None:
        validate_quantities(self)


def in_range(value: object, metadata: Any) -> bool:
    """Whether a value is a number within the bounds of a quantity."""
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
        and value > metadata["above"]
        and metadata["at_least"] <= value <= metadata["at_most"]
    )


def unit_guess(value: object, unit: str, low: float, high: float) -> str:
    """Units in which a number would lie within the bounds of its key; "" if it would in none."""
    if not isinstance(value, int | float) or math.isinf(high):
        return ""
    suffix = "" if unit == "1" else f" {unit}"
    fitting = [
        f"{value:g} {name} would be {rounded(factor * value)}{suffix}"
        for name, factor in _FOREIGN.get(unit, ())
        if low <= factor * value <= high
    ]
    return f"; {', '.join(fitting[:2])}" if fitting else ""


def degrees_hint(heading: float) -> str:
    """Hint behind a refusal whose heading [rad] is beyond a turn; "" for one within.

    Such a heading is no error: it may be counted on from turn to turn.
    """
    return f"; {heading:g} rad is more than a turn: degrees?" if abs(heading) > math.tau else ""


def rounded(value: float) -> str:
    """Three digits of a number, without an exponent up to ten million."""
    return f"{float(f'{value:.3g}'):.8g}"


def validate_range(name: str, bounds: tuple[float, float]) -> None:
    """Check that a range has two ends, the lower one first.

    Raises:
        ParameterError: names the field and what was expected.
    """
    low, high = bounds
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ParameterError(name, f"two finite numbers, low < high, got [{low:g}, {high:g}]")


def validate_angles(name: str, bounds: tuple[float, float]) -> None:
    """Check a range of slopes [rad]: two ends, the lower one first, neither beyond upright.

    Degrees taken for radians would make every slope one that was trained.

    Raises:
        ParameterError: names the field and what was expected.
    """
    validate_range(name, bounds)
    if max(abs(bounds[0]), abs(bounds[1])) > STEEPEST:
        expected = f"radians between -{STEEPEST:.2f} and {STEEPEST:.2f}"
        raise ParameterError(name, f"{expected}, got [{bounds[0]:g}, {bounds[1]:g}]: degrees?")


def validate_covariance(name: str, covariance: Matrix | None, size: int) -> None:
    """Check that a matrix can be a covariance of as many parameters; None passes.

    Raises:
        ParameterError: names the field and what was expected.
    """
    if covariance is None or (size == 0 and len(covariance) == 0):
        return
    if len(covariance) != size or any(len(row) != size for row in covariance):
        raise ParameterError(name, f"a {size} x {size} matrix")
    if expected := _expected_of(tuple(map(tuple, covariance))):
        raise ParameterError(name, expected)


@lru_cache(maxsize=512)
def _expected_of(covariance: Matrix) -> str:
    """Expected property that a square matrix lacks; "" for a covariance.

    Models are made again and again with the same ones: each surface of a model has its own.
    """
    matrix = np.asarray(covariance)
    scale = float(np.max(np.abs(matrix)))
    if not (np.isfinite(scale) and np.allclose(matrix, matrix.T, rtol=1e-6, atol=1e-12 * scale)):
        return "a finite symmetric matrix"
    if np.linalg.eigvalsh(matrix)[0] < -1e-9 * scale:
        return "a positive semidefinite matrix, got a negative eigenvalue"
    return ""
