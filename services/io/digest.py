"""Digests by which a file, or a model in memory, is found again years later."""

from __future__ import annotations

import hashlib
from pathlib import Path

from slopewise.services.io.access import fault, reason

_BLOCK = 1 << 20


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, as `sha256sum` tells it; of a folder that of its files and their names.

    Raises:
        InputError: it cannot be read.
    """
    digest = hashlib.sha256()
    try:
        if not path.is_dir():
            return _of_file(path)
        for file in sorted(p for p in path.rglob("*") if p.is_file()):
            digest.update(f"{_of_file(file)}  {file.relative_to(path).as_posix()}\n".encode())
    except OSError as error:
        raise fault(path, "", f"expected a readable file, got: {reason(error)}") from None
    return digest.hexdigest()


def _of_file(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()
