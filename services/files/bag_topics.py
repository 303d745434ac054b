"""Topic mappings: which messages of a recording hold which column of a drive log."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from models.errors import ParameterError
from models.quantity import quantity, validate_quantities
from services.files.access import fault, read_text, reason
from services.files.decode import decode_table, dotted
from services.files.drive_log import REQUIRED

ATTITUDE = ("roll", "pitch", "yaw")
_NO_COLUMN = ("run", "t")


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


def read_topics(path: Path | None) -> tuple[dict[str, Channel], str]:
    """The mapping by column, and the name of its file; without one, the mapping that is shipped.

    Raises:
        InputError: names the file and the dotted key.
    """
    path = path or Path(str(resources.files("configs") / "topics.toml"))
    try:
        tables = tomllib.loads(read_text(path))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise fault(path, "", f"expected TOML, got: {reason(error)}") from None
    channels = {}
    for column, table in tables.items():
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
