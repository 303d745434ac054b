"""Check that a fault of a file is one line that names the file and the field."""

from __future__ import annotations

import contextlib
import os
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from slopewise.models.errors import InputError

DATA = Path(os.environ.get("SLOPEWISE_DATA", Path(__file__).parents[3] / "shared" / "data"))

BAD_INPUTS = Path(__file__).parent / "io" / "bad_inputs"


def real_data(name: str) -> Path:
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{name} is not here: set SLOPEWISE_DATA to the folder of the real recordings")
    return path


def bad_inputs(name: str) -> list[list[Any]]:
    """Cases of `io/bad_inputs/NAME.toml`: input, field of the error, text in its message."""
    cases: list[list[Any]] = tomllib.loads((BAD_INPUTS / f"{name}.toml").read_text())["cases"]
    return cases


@contextlib.contextmanager
def fault_in(source: Path | str, field: str, *texts: str) -> Iterator[None]:
    """Check that a block raises an InputError of that source and field with these texts in it."""
    with pytest.raises(InputError) as caught:
        yield
    error = caught.value
    message = str(error)
    assert error.field == field, message
    assert error.source == str(source), message
    assert len(message.splitlines()) == 1, message
    assert message.isprintable(), message
    assert message.startswith(f"{source}: {field}" if field else str(source)), message
    for text in texts:
        assert text in message, message
    assert error.__suppress_context__ or error.__context__ is None
