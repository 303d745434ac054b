"""A folder of results belongs to one question: a second run goes on in it, another is refused."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from slopewise.services.io.files import fault, read_text, reason, write_atomic

_RUN = "fleet.json"


def open_folder(folder: Path, parts: Sequence[str], question: str, what: str) -> str:
    """Make the folder, or go on in one that answers the same question.

    Args:
        folder: of results. parts: folders in it. question: digest of what is asked.
        what: all that has to be the same, in words.

    Returns:
        The day on which it was begun: a run that goes on writes what the first one would have.

    Raises:
        InputError: it cannot be written to, or is of another question.
    """
    note = folder / _RUN
    try:
        for part in parts:
            (folder / part).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise fault(folder, "", f"expected a folder to write to, got: {reason(error)}") from None
    if not note.exists():
        begun = f"{date.today()}"
        write_atomic(note, json.dumps({"question": question, "begun": begun}).encode())
        return begun
    try:
        told = json.loads(read_text(note))
        before, begun = str(told["question"]), str(told["begun"])
    except (ValueError, KeyError, TypeError):
        raise fault(note, "question", "expected the digest of a run, got none") from None
    if before != question:
        words = f"expected an empty folder, or one begun with the same {what} and version"
        raise fault(folder, "", f"{words}; got results of others")
    return begun


def sweep(folder: Path, parts: Sequence[str]) -> None:
    """Remove what workers that were killed left half written: the whole files are there by now."""
    for part in parts:
        for stray in (folder / part).rglob(".*.tmp"):
            stray.unlink(missing_ok=True)
