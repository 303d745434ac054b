"""Arguments of public functions against their annotations: another kind is a ParameterError.

The annotations are the contract. Without this, text in place of a number, or the name of a file in
place of a map, fails deep inside, with an error that names nothing the caller wrote.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from os import PathLike
from types import GenericAlias, NoneType, UnionType
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from slopewise.models.errors import ParameterError

P = ParamSpec("P")
R = TypeVar("R")

_MAX_SHOWN = 60
"""Characters of a value that an error shows [1]."""

_NOUNS = {float: "a number", int: "a whole number", str: "a text", PathLike: "a path"}
_SCALARS = {float: "iuf", int: "iu", bool: "b"}
"""Kinds of numpy's types that each takes: numbers are neither bool, nor complex, nor text."""


def typed_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """The function, where an argument that its annotation excludes is a ParameterError.

    Numbers may be Python's or numpy's, a tuple of numbers any row of as many, arrays any
    that numpy reads as numbers, and a sequence any collection.
    """
    signature = inspect.signature(function)
    rows = [n for n, p in signature.parameters.items() if p.kind is p.VAR_POSITIONAL]

    @functools.cache
    def kinds() -> dict[str, Any]:  # read at the first call, when all modules are loaded
        hints: dict[str, Any] = get_type_hints(function)
        return hints | {name: GenericAlias(tuple, (hints[name], ...)) for name in rows}

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        for name, value in signature.bind(*args, **kwargs).arguments.items():
            if name in kinds():
                _check(name, value, kinds()[name])
        return function(*args, **kwargs)

    return checked


def check_fields(instance: Any) -> None:
    """Check that the fields of a dataclass are as annotated.

    Raises:
        ParameterError: names the field and what was expected.
    """
    for name, kind in _fields_of(instance.__class__).items():
        _check(name, getattr(instance, name), kind)


_fields_of = functools.cache(get_type_hints)


def _check(name: str, value: Any, kind: Any) -> None:
    members = _members(kind)
    if type(value) in members:  # of most values, and quick
        return
    if not any(_matches(name, value, member) for member in members):
        raise ParameterError(name, f"{_noun(kind)}, got {_shown(value)}")


def _matches(name: str, value: Any, kind: Any) -> bool:
    """Whether a value is of a kind that is no union; elements of collections are checked."""
    origin, arguments = get_origin(kind), get_args(kind)
    if kind in _SCALARS:
        return _is_numeric(value, (), _SCALARS[kind])
    if origin is np.ndarray:
        return _is_numeric(value, None, "biuf")
    if origin is Literal:
        return isinstance(value, str) and value in arguments
    if origin is tuple and arguments[-1] is not Ellipsis:
        return _is_numeric(value, (len(arguments),), "iuf")
    if origin in (tuple, Sequence):
        if not isinstance(value, Collection) or isinstance(value, str | bytes | Mapping):
            return False
        for index, element in enumerate(value):
            _check(f"{name}[{index}]", element, arguments[0])
        return True
    return kind is Any or isinstance(value, origin or kind)


def _is_numeric(value: Any, shape: tuple[int, ...] | None, kinds: str) -> bool:
    """Whether numpy reads a value as numbers of these kinds; without a shape as any array."""
    try:
        array = np.asarray(value)
        if array.dtype.kind in "OUS" and shape is None:  # tables have columns of such types
            array = array.astype(np.float64)
    except (TypeError, ValueError):
        return False
    fits = array.ndim > 0 if shape is None else array.shape == shape
    return fits and array.dtype.kind in kinds


@functools.cache
def _members(kind: Any) -> tuple[Any, ...]:
    return get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)


def _noun(kind: Any) -> str:
    """Name of a kind in an error."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return " or ".join(_noun(member) for member in arguments)
    if origin is Literal:
        return " or ".join(map(repr, arguments))
    if origin is tuple and arguments[-1] is not Ellipsis:
        return f"{len(arguments)} numbers"
    if origin in (tuple, Sequence):
        return f"a list (each item: {_noun(arguments[0])})"
    if origin is np.ndarray:
        return "an array of numbers"
    kind = origin or kind
    return _NOUNS.get(kind, "None" if kind is NoneType else kind.__name__)


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if value is None or isinstance(value, str | bytes | bool | int | float | complex):
        text = repr(value)
        return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}…"
    if isinstance(value, list | tuple | dict):
        return f"a {type(value).__name__} of {len(value)}"
    return type(value).__name__
