"""Results for the last few arguments, which never change."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

Result = TypeVar("Result")

_COUNT = 4
"""Results that are cached [1]: of the arguments in use, of the next, and of two comparisons."""


class Recent(Generic[Result]):
    """Results by their arguments, which are compared as objects; numbers and names by value.

    The entries are replaced as a whole and never changed, so that threads need no lock: two of them
    may compute the same result.
    """

    def __init__(self, count: int = _COUNT) -> None:
        """Cache at most ``count`` results; their arguments stay in memory with them."""
        self._count = count
        self._entries: tuple[tuple[tuple[object, ...], Result], ...] = ()

    def get(self, make: Callable[[], Result], *arguments: object) -> Result:
        """The result for these arguments, made if none of the last few were the same."""
        for known, result in self._entries:
            if all(map(_is_same, known, arguments)):
                return result
        result = make()
        self.put(result, *arguments)
        return result

    def put(self, result: Result, *arguments: object) -> None:
        """Cache a result for these arguments."""
        self._entries = ((arguments, result), *self._entries[: self._count - 1])


def _is_same(known: object, argument: object) -> bool:
    return known is argument or (isinstance(known, float | tuple) and known == argument)
