"""What the results of a drive depend on: sources, libraries, elevation models."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

from ..common.kept import KeptPickles, digest_of_sources
from .scenes import dem_folder

_SOURCES = ("benchmarks/closed_loop", "models", "planner")
_SHOWING = ("film.py", "pictures.py", "tables.py")
"""What only shows results does not change them."""

_LIBRARIES = ("mujoco", "numpy", "scipy")


def kept(folder: Path, what: str, *origins: object) -> KeptPickles:
    """Where results of one kind are kept.

    Args:
        folder: of the whole campaign. what: kind of work.
        origins: what the results depend on beside sources and data, by their representation.
    """
    digest = hashlib.sha256(repr((_origin(), *origins)).encode())
    name = "".join(c if c.isalnum() else "_" for c in what)
    return KeptPickles(folder / f"{name}-{digest.hexdigest()[:16]}")


@cache
def _origin() -> str:
    """Digest of sources, libraries and elevation models."""
    dem = dem_folder()
    models = sorted(dem.glob("*.tif")) if dem is not None else []
    return digest_of_sources(
        _SOURCES,
        _SHOWING,
        *(version(name) for name in _LIBRARIES),
        *(f"{file.name} {file.stat().st_size}" for file in models),
    )
