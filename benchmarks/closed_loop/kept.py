"""Results on disk, one file a drive: an interrupted campaign goes on where it was.

What is kept is named by everything that it came from, so that nothing old is ever taken for new:
the sources of benchmark, planner and laws, the engine, the elevation models, the learned model.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from .scenes import dem_folder

_SOURCES = ("benchmarks/closed_loop", "models", "planner")
_SHOWING = ("film.py", "pictures.py", "tables.py")
"""What only shows results does not change them."""

_LIBRARIES = ("mujoco", "numpy", "scipy")


@dataclass(frozen=True, slots=True)
class Kept:
    """Results of one kind of work; the folder holds pickles, so it must be one's own.

    Attributes:
        folder: made when something is put into it.
    """

    folder: Path

    def find(self, number: int) -> Any | None:
        """What was put in for a job, None if nothing was."""
        file = self._file(number)
        return pickle.loads(file.read_bytes()) if file.exists() else None

    def put(self, number: int, result: Any) -> None:
        """Keep a result, all or nothing."""
        file = self._file(number)
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f".{os.getpid()}")
        partial.write_bytes(pickle.dumps(result))
        partial.replace(file)

    def _file(self, number: int) -> Path:
        return self.folder / f"{number}.pkl"


def kept(folder: Path, what: str, *origins: object) -> Kept:
    """Where results of one kind are kept.

    Args:
        folder: of the whole campaign. what: kind of work.
        origins: what the results depend on beside sources and data, by their representation.
    """
    digest = hashlib.sha256(_origin().encode())
    for origin in origins:
        digest.update(repr(origin).encode())
    name = "".join(c if c.isalnum() else "_" for c in what)
    return Kept(folder / f"{name}-{digest.hexdigest()[:16]}")


@cache
def _origin() -> str:
    """Digest of sources, libraries and elevation models."""
    root = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256(repr([version(name) for name in _LIBRARIES]).encode())
    for part in _SOURCES:
        for file in sorted((root / part).rglob("*.py")):
            if file.name in _SHOWING:
                continue
            digest.update(str(file.relative_to(root)).encode() + file.read_bytes())
    dem = dem_folder()
    models = sorted(dem.glob("*.tif")) if dem is not None else []
    digest.update(repr([(file.name, file.stat().st_size) for file in models]).encode())
    return digest.hexdigest()
