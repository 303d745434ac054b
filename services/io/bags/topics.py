"""Topic mappings: which messages of a recording hold map, candidates, columns of a drive log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import quantity, validate_quantities
from slopewise.services.io.access import fault
from slopewise.services.io.decode import decode_table, dotted
from slopewise.services.io.logs.drive_log import REQUIRED
from slopewise.services.io.shipped import shipped_folder
from slopewise.services.io.toml_file import read_toml

ATTITUDE = ("roll", "pitch", "yaw")
_NO_COLUMN = ("run", "t")
_SOURCES = ("map", "paths")


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """Where the values of one column are.

    Attributes:
        topic: its name. field: dotted path of a number in the message; of a joint's, one of its
            lists. quaternion: dotted path of an orientation. joint: name of a joint.
        scale, offset: value = scale * number + offset. hold: the last message holds till the next.
    """

    topic: str
    field: str | None = None
    quaternion: str | None = None
    joint: str | None = None
    scale: float = quantity("1", "Factor to the unit of the drive log.", default=1.0)
    offset: float = quantity("1", "Added after scaling, in the drive log's unit.", default=0.0)
    hold: bool = False

    def __post_init__(self) -> None:
        validate_quantities(self)
        if (self.field is None) == (self.quaternion is None):
            raise ParameterError("field", "either field or quaternion")
        if self.joint is not None and self.field not in ("position", "velocity", "effort"):
            raise ParameterError("field", "position, velocity or effort for a joint")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSource:
    """Where the elevation map is.

    Attributes:
        topic: of grid maps; empty: the only one. layer: of the heights; empty: `elevation`.
        message: its number from 0, -1 for the last.
    """

    topic: str = ""
    layer: str = ""
    message: int = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class PathSource:
    """Where candidates are: topics of paths, all if none is named.

    Attributes:
        all_messages: each message is a candidate, not only the last of each topic.
    """

    topics: tuple[str, ...] = ()
    all_messages: bool = False


def read_sources(path: Path | None) -> tuple[MapSource, PathSource]:
    """Where map and candidates are; without a mapping, what there is one of.

    Raises:
        InputError: names the file and the dotted key.
    """
    if path is None:
        return MapSource(), PathSource()
    tables = read_toml(path)
    return (
        decode_table(MapSource, tables.get("map", {}), str(path), "map"),
        decode_table(PathSource, tables.get("paths", {}), str(path), "paths"),
    )


def read_topics(path: Path | None) -> tuple[dict[str, Channel], str]:
    """The mapping by column, and the name of its file; without one, the mapping that is shipped.

    Raises:
        InputError: names the file and the dotted key.
    """
    path = path or shipped_folder() / "topics.toml"
    channels = {}
    for column, table in read_toml(path).items():
        if column in _SOURCES:
            continue
        if column in _NO_COLUMN:
            raise fault(path, dotted("", column), "expected a measured column, this one is made")
        channel = decode_table(Channel, table, str(path), dotted("", column))
        if channel.quaternion is not None and column not in ATTITUDE:
            words = f"expected one of {', '.join(ATTITUDE)} from a quaternion, got {column}"
            raise fault(path, dotted("", column), words)
        channels[column] = channel
    for column in REQUIRED:
        if column != "t" and column not in channels:
            raise fault(path, column, "missing table, every drive log needs this column")
    return channels, str(path)
