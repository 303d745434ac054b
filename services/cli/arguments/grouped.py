"""Commands that take their words as one dataclass, instead of a parameter for each."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, fields
from typing import Any, TypeVar, get_type_hints

T = TypeVar("T")


def takes(kind: type[T]) -> Callable[[Callable[[T], None]], Callable[..., None]]:
    """Let typer see each field of a dataclass as an argument or option of a command.

    Args:
        kind: a dataclass; each annotation holds typer's words, each default is the option's.
    """
    hints = get_type_hints(kind, include_extras=True)

    def decorate(command: Callable[[T], None]) -> Callable[..., None]:
        def called(**words: Any) -> None:
            command(kind(**words))

        called.__name__, called.__doc__ = command.__name__, command.__doc__
        called.__annotations__ = hints
        signature = inspect.Signature(
            [
                inspect.Parameter(
                    field.name,
                    inspect.Parameter.KEYWORD_ONLY,
                    annotation=hints[field.name],
                    default=inspect.Parameter.empty if field.default is MISSING else field.default,
                )
                for field in fields(kind)  # type: ignore[arg-type]
            ]
        )
        called.__signature__ = signature  # type: ignore[attr-defined]
        return called

    return decorate
