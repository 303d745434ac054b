"""Path files cut into parts that are planned, written and counted as one.

How files are cut depends on nothing but their content, so that any number of workers gives the same
parts with the same bytes. A part's key is a digest of all that its plans depend on: of the paths,
the model, the map, the settings and the version. A part that is written under its key is finished.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.files import check_file
from slopewise.services.io.map_grid import Around
from slopewise.services.io.no_data import NoData
from slopewise.services.io.path_file import check_paths_on_map, read_paths

PART = 500
"""Candidates of a part: a few seconds of work, some megabytes of results."""

_ENDS = 1 << 16  # bytes at either end of a map that are looked at
_FORMAT = 2  # of the results; another one is planned anew


@dataclass(frozen=True, slots=True)
class FleetQuestion:
    """What is asked about every path; plain values, so that it travels.

    Attributes:
        map_file: GeoTIFF, under the name by which the workers see it.
        model: tables of a model file.
        settings: of the planner. start_speed [m/s], clear [m], uncertainty, nodata: as `slopewise
            plan` has them.
    """

    map_file: str
    model: dict[str, Any]
    settings: PlannerSettings
    start_speed: float
    clear: float
    uncertainty: Uncertainty | None = None
    nodata: NoData = None

    def digest(self) -> str:
        """Of all but the paths, and of the version that answers."""
        told = [
            _FORMAT,
            version("slopewise"),
            PART,
            map_digest(Path(self.map_file)),
            json.dumps(self.model, sort_keys=True),
            repr(self.settings),
            repr(float(self.start_speed)),
            repr(float(self.clear)),
            repr(self.uncertainty),
            repr(self.nodata),
        ]
        return hashlib.sha256("\n".join(map(str, told)).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class PartName:
    """Where a part comes from, and the name that its results have.

    Attributes:
        source: file of the paths. first, count: which of its candidates. key: see above.
    """

    source: Path
    first: int
    count: int
    key: str

    @property
    def file(self) -> str:
        """Name of its result files: readable in front, unmistakable behind."""
        return f"{self.source.stem[:60]}-{self.first:07d}-{self.key[:20]}.parquet"


@dataclass(frozen=True, slots=True)
class Part:
    """A part with its paths, as a worker gets it."""

    name: PartName
    paths: tuple[CandidatePath, ...]


def map_digest(path: Path) -> str:
    """What tells one map from another without reading gigabytes: size, time, and both ends."""
    check_file(path)
    stat = path.stat()
    digest = hashlib.sha256(f"{stat.st_size} {stat.st_mtime_ns}".encode())
    with path.open("rb") as file:
        digest.update(file.read(_ENDS))
        file.seek(max(stat.st_size - _ENDS, 0))
        digest.update(file.read(_ENDS))
    return digest.hexdigest()


def parts_of(source: Path, question: str, extent: Around, map_file: str) -> Iterator[Part]:
    """The parts of one file.

    Args:
        source: of paths. question: :meth:`FleetQuestion.digest`.
        extent: of the map [m], on which every path has to begin.

    Raises:
        InputError: names row and column.
    """
    paths = read_paths(source)
    check_paths_on_map(paths, extent, str(source), map_file)
    for first in range(0, len(paths), PART):
        some = tuple(paths[first : first + PART])
        key = _key(question, source.name, first, some)
        yield Part(PartName(source, first, len(some), key), some)


def _key(question: str, source: str, first: int, paths: Sequence[CandidatePath]) -> str:
    digest = hashlib.sha256(json.dumps([question, source, first]).encode())
    for path in paths:
        digest.update(json.dumps([path.name, len(path.points)]).encode())
        for values in (path.points, path.speed_limit, path.yaw):
            digest.update(b"-" if values is None else np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()
