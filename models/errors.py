"""Errors of input. An infeasible plan is a status, not an error."""

from __future__ import annotations


class SlopewiseError(Exception):
    """Base of every error that is the input's fault and not the program's."""


class ParameterError(SlopewiseError, ValueError):
    """A parameter is outside its range or contradicts another.

    Attributes:
        field: dotted name of the key, e.g. ``vehicle.mass``.
        expected: what was expected, and what was found.
    """

    def __init__(self, field: str, expected: str) -> None:
        super().__init__(f"{field}: expected {expected}")
        self.field = field
        self.expected = expected

    def __reduce__(self) -> tuple[type[ParameterError], tuple[str, str]]:
        """Errors travel between processes."""
        return type(self), (self.field, self.expected)


class InputError(SlopewiseError):
    """A file or message cannot be used. One line: which source, which field, what was expected.

    Attributes:
        source: file name or message key.
        field: row, column or key inside it; empty if the source as a whole is wrong.
        expected: what was expected, and what was found.
    """

    def __init__(self, source: str, field: str, expected: str) -> None:
        where = f"{source}: {field}" if field else source
        super().__init__(f"{where}: {expected}")
        self.source = source
        self.field = field
        self.expected = expected

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str]]:
        """Errors travel between processes."""
        return type(self), (self.source, self.field, self.expected)
