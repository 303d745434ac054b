"""Folder of results of one request: a second run resumes in it, another request is rejected."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Sequence
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

from slopewise.services.io.files import (
    check_file,
    fault,
    read_text,
    real_path,
    reason,
    write_atomic,
)

_RUN = "fleet.json"
_END_BYTES = 1 << 16  # Bytes at either end of a map that its digest covers


def vehicles_of(logs: Sequence[Path], by_folder: bool) -> dict[str, list[Path]]:
    """Logs of each vehicle in the order given: those of a folder, or each file."""
    grouped: dict[str, list[Path]] = {}
    for log in logs:
        folder = real_path(log).parent
        name = folder.name if by_folder else log.stem
        logs_of_name = grouped.setdefault(name, [])
        first = logs_of_name[0] if logs_of_name else None
        if first and (not by_folder or real_path(first).parent != folder):
            message = f"expected a unique name of the vehicle, got another {name} in {first}"
            hint = "" if by_folder else "; --by-folder takes the logs of a folder together"
            raise fault(log, "", message + hint)
        logs_of_name.append(log)
    return grouped


def open_folder(folder: Path, parts: Sequence[str], request: str, inputs: str) -> str:
    """Make the folder with its parts, or resume in one of the same request.

    ``request`` is a digest, ``inputs`` names for messages what has to be the same. Returns the date
    on which it was begun: a resumed run writes what the first one would have.
    """
    note = folder / _RUN
    for part in parts:
        make_folder(folder / part, folder)
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


def make_folder(folder: Path, named: Path) -> None:
    """Make a folder, or raise InputError of the one that the user named."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise fault(named, "", f"expected a folder to write to, got: {reason(error)}") from None


def remove_partial_files(folder: Path, parts: Sequence[str]) -> None:
    """Remove files that killed workers left half written: the complete ones exist by now."""
    for part in parts:
        for partial in (folder / part).rglob(".*.tmp"):
            partial.unlink(missing_ok=True)


def digest_of(form: int, *inputs: object) -> str:
    """Digest of what results depend on: their format, the version of slopewise, inputs."""
    lines = map(str, (form, version("slopewise"), *inputs))
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def map_digest(path: Path) -> str:
    """Digest of size, time and both ends of a map: identifies it without reading gigabytes."""
    check_file(path)
    stat = path.stat()
    digest = hashlib.sha256(f"{stat.st_size} {stat.st_mtime_ns}".encode())
    with path.open("rb") as file:
        digest.update(file.read(_END_BYTES))
        file.seek(max(stat.st_size - _END_BYTES, 0))
        digest.update(file.read(_END_BYTES))
    return digest.hexdigest()


def write_parquet(path: Path, table: Any) -> None:
    """Write a pyarrow table, all or nothing."""
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    write_atomic(path, buffer.getvalue())
