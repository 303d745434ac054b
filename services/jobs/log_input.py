"""Drive logs, and how a job reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from slopewise.models.arrays import Floats
from slopewise.models.vehicle import Vehicle
from slopewise.services.io.drive_log import DriveLog, read_logs
from slopewise.services.io.log_checks import names_of
from slopewise.services.io.no_data import NoData
from slopewise.services.io.track_grade import grade_by_map


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
        """The files as text, for messages."""
        return names_of(self.files)

    def read(self) -> DriveLog:
        """Read all files as one log."""
        return read_logs(self.files, self.topics, self.columns)

    def grade(self, log: DriveLog, vehicle: Vehicle) -> Floats | None:
        """Grade of the ground at each sample [rad], None without a map."""
        return grade_by_map(log, self.map_file, vehicle, self.nodata)
