"""Path files cut into parts that are planned, written and counted as one.

How files are cut depends only on their content, so that any number of workers gives the same
parts with the same bytes. The key of a part is a digest of all that its plans depend on: paths,
model, map, settings and version. A part that is written under its key is finished.
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

PART = 500  # Candidates of a part: a few seconds of work, some megabytes of results
_END_BYTES = 1 << 16  # Bytes at either end of a map that its digest covers
_FORMAT = 2  # Version of the results; results of another one are planned again


@dataclass(frozen=True, slots=True)
class FleetPlanSpec:
    """Inputs of every plan; plain values, so that it can be sent to workers.

    Attributes:
        start_speed [m/s], clear [m], uncertainty, nodata: as in `slopewise plan`.
    """

    map_file: str
    model: dict[str, Any]
    settings: PlannerSettings
    start_speed: float
    clear: float
    uncertainty: Uncertainty | None = None
    nodata: NoData = None

    def digest(self) -> str:
        """Digest of all but the paths, and of the version that plans."""
        inputs = [
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
        return hashlib.sha256("\n".join(map(str, inputs)).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class PartName:
    """Origin of a part, and the name of its results.

    Attributes:
        source: file of the paths. first, count: range of its candidates. key: digest of its inputs.
    """

    source: Path
    first: int
    count: int
    key: str

    @property
    def file(self) -> str:
        """Name of its result files: readable at the front, unique at the end."""
        return f"{self.source.stem[:60]}-{self.first:07d}-{self.key[:20]}.parquet"


@dataclass(frozen=True, slots=True)
class Part:
    """A part with its paths, as sent to a worker."""

    name: PartName
    paths: tuple[CandidatePath, ...]


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


def parts_of(source: Path, spec: str, extent: Around, map_file: str) -> Iterator[Part]:
    """The parts of one file.

    Args:
        source: path file. spec: :meth:`FleetPlanSpec.digest`.
        extent: area of the map [m] on which every path has to begin.
    """
    paths = read_paths(source)
    check_paths_on_map(paths, extent, str(source), map_file)
    for first in range(0, len(paths), PART):
        members = tuple(paths[first : first + PART])
        key = _key(spec, source.name, first, members)
        yield Part(PartName(source, first, len(members), key), members)


def _key(spec: str, source: str, first: int, paths: Sequence[CandidatePath]) -> str:
    digest = hashlib.sha256(json.dumps([spec, source, first]).encode())
    for path in paths:
        digest.update(json.dumps([path.name, len(path.points)]).encode())
        for values in (path.points, path.speed_limit, path.yaw):
            digest.update(b"-" if values is None else np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()
