"""Drive logs, and how a job reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Model
from slopewise.models.vehicle import Vehicle
from slopewise.services.io.columns import in_own_units, parse_names
from slopewise.services.io.drive_log import DriveLog, read_logs
from slopewise.services.io.files import real_path
from slopewise.services.io.log_checks import refuse_too_fast, refuse_wrong_units
from slopewise.services.io.no_data import NoData
from slopewise.services.io.track_grade import grade_by_map

_SHOWN = 3  # files that a message names [1]


@dataclass(frozen=True, slots=True)
class LogInput:
    """Tables or recordings of one log, and what their reader has to know."""

    files: Sequence[Path]
    map_file: Path | None = None  # elevation map that x, y of the logs lie on
    nodata: NoData = None  # height of the map that marks unknown ground [m]
    topics: Path | None = None  # topic mapping of recordings
    columns: str = ""  # names and units of tables that differ

    @property
    def names(self) -> str:
        """The files as text, for messages: the first few of many."""
        shown = ", ".join(map(str, self.files[:_SHOWN]))
        many = len(self.files) > _SHOWN
        return f"{shown} … ({len(self.files)} logs)" if many else shown

    def resolved(self, files: Sequence[Path]) -> LogInput:
        """Other files read likewise, by absolute paths: a worker may run elsewhere."""
        map_file, topics = (p and real_path(p) for p in (self.map_file, self.topics))
        files = tuple(map(real_path, files))
        return replace(self, files=files, map_file=map_file, topics=topics)

    def read(self) -> DriveLog:
        """Read all files as one log."""
        return read_logs(self.files, self.topics, self.columns)

    def read_for(self, model: Model) -> DriveLog:
        """Read all files as one log; InputError where its units, or its speeds, look wrong."""
        log = self.read()
        refuse_wrong_units(log)
        refuse_too_fast(log, model)
        return log

    def grade(self, log: DriveLog, vehicle: Vehicle) -> Floats | None:
        """Grade of the ground at each sample [rad], None without a map."""
        if self.map_file is None:
            return None
        return grade_by_map(log, self.map_file, vehicle, self.nodata)

    def in_own_units(self, sentence: str) -> str:
        """The sentence with its numbers in the units that the files have."""
        return in_own_units(sentence, parse_names(self.columns))
