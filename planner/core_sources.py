"""The digest of the core's sources, for its build and for its import."""

from __future__ import annotations

import hashlib
from pathlib import Path


def digest_of_core(folder: Path) -> str:
    """Of all files in `planner/core` that the compiled core is made of: not of its face for C++."""
    digest = hashlib.sha256()
    for source in sorted(folder.rglob("*")):
        if source.suffix in (".cpp", ".hpp", ".txt") and source.parent.name != "slopewise":
            digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()
