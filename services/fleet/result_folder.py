"""Folder of results of one request: a second run resumes in it, another request is rejected."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from slopewise.services.io.files import fault, read_text, reason, write_atomic

_RUN = "fleet.json"


def open_folder(folder: Path, parts: Sequence[str], request: str, inputs: str) -> str:
    """Make the folder, or resume in one of the same request.

    Args:
        folder: for results. parts: folders in it. request: its digest.
        inputs: names of what has to be the same, for messages.

    Returns:
        Date on which it was begun: a resumed run writes what the first one would have.
    """
    note = folder / _RUN
    try:
        for part in parts:
            (folder / part).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise fault(folder, "", f"expected a folder to write to, got: {reason(error)}") from None
    if not note.exists():
        begun = f"{date.today()}"
        write_atomic(note, json.dumps({"question": request, "begun": begun}).encode())
        return begun
    try:
        stored = json.loads(read_text(note))
        before, begun = str(stored["question"]), str(stored["begun"])
    except (ValueError, KeyError, TypeError):
        raise fault(note, "question", "expected the digest of a run, got none") from None
    if before != request:
        message = f"expected an empty folder, or one begun with the same {inputs} and version"
        raise fault(folder, "", f"{message}; got results of others")
    return begun


def remove_partial_files(folder: Path, parts: Sequence[str]) -> None:
    """Remove files that killed workers left half written: the complete ones exist by now."""
    for part in parts:
        for partial in (folder / part).rglob(".*.tmp"):
            partial.unlink(missing_ok=True)
