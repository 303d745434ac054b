"""Summaries of results: what `--json` prints, with a schema."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any, Self, TypeVar

import msgspec

from slopewise.models.errors import ParameterError
from slopewise.services.io.files import fault

T = TypeVar("T")


class Summary(msgspec.Struct, frozen=True, omit_defaults=True):
    """Base of what a command prints as JSON: SI units and radians.

    A field with a default is absent from the JSON while it holds it.
    """

    @classmethod
    def of(cls, source: object, **given: Any) -> Self:
        """Fields as given, the others from the attributes of the source with the same names."""
        names = (name for name in cls.__struct_fields__ if name not in given)
        return cls(**{name: getattr(source, name) for name in names}, **given)


def to_json(summary: object) -> str:
    """One line of JSON; a ValueError for a number that is not finite."""
    return json.dumps(msgspec.to_builtins(summary, enc_hook=_plain), allow_nan=False)


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)


@contextmanager
def input_errors(source: object, options: Collection[str] = ()) -> Iterator[None]:
    """Turn a ParameterError of the block into an InputError that names its source.

    Some parameters are options themselves: `speed` is `--speed`.
    """
    try:
        yield
    except ParameterError as error:
        option = error.field in options
        where = (option_of(error.field), "") if option else (source, error.field)
        raise fault(*where, f"expected {error.expected}") from None


def from_options(kind: type[T], **values: Any) -> T:
    """Settings of a kind from options of the same names; None keeps the default."""
    with input_errors("", tuple(values)):
        return kind(**{name: value for name, value in values.items() if value is not None})


def option_of(parameter: str) -> str:
    """The option of a parameter, `--false-alarm` of `false_alarm`."""
    return f"--{parameter.replace('_', '-')}"
