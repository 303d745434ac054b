"""The part of a map that paths need."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.models.vehicle import Vehicle
from slopewise.services.io.bags import is_bag
from slopewise.services.io.map_file import map_info, read_map_around
from slopewise.services.io.no_data import NoData
from slopewise.services.io.path_file import check_paths_on_map


def refuse_topics(topics: Path | None, *files: Path) -> None:
    """Raise InputError for a topic mapping where no file is a recording."""
    if topics is not None and not any(map(is_bag, files)):
        expected = "expected a recording with a topic mapping, got files of other kinds"
        raise InputError(str(topics), "", expected)


def read_ground(
    map_file: Path,
    paths: Sequence[CandidatePath],
    path_file: Path,
    vehicle: Vehicle,
    *,
    topics: Path | None,
    nodata: NoData,
    reach: float = 0.0,
) -> ElevationMap:
    """Read the map around paths, as far as the vehicle and a further reach [m] from each point."""
    extent = map_info(map_file, topics).extent
    check_paths_on_map(paths, extent, str(path_file), str(map_file))
    points = np.concatenate([path.points for path in paths])
    return read_map_around(map_file, points, vehicle, reach=reach, topics=topics, nodata=nodata)
