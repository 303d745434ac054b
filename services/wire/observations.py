"""What robots and their estimators tell: stops, drive samples, labels of the ground.

SI units, angles in radians. Each sender counts its messages of a kind, and stamps them with a clock
of its own that runs as fast as time does; where it begins is all the same.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta

from slopewise.services.wire.messages import Instance, Message, Name, Number, Text

Surface = Annotated[str, Meta(max_length=40, pattern=r"^[A-Za-z0-9_-]*$")]
Positive = Annotated[float, Meta(gt=0.0)]
Probability = Annotated[float, Meta(ge=0.0, le=1.0)]
Std = Annotated[float, Meta(ge=0.0, le=10.0)]

DRIVE_COLUMNS = ("t", "v", "v_cmd", "pitch")
"""Columns that drive samples have to have, as in a drive log."""

MORE_COLUMNS = (
    "roll",
    "yaw_rate",
    "v_left",
    "v_right",
    "current_left",
    "current_right",
    "grade",
    "yaw",
    "x",
    "y",
)
"""Columns that they may have beside them; `grade` is that of the ground, from a map."""


class RobotObservation(Message, frozen=True, kw_only=True):
    """What every observation has.

    Attributes:
        source: who saw it. sequence: grows with every message of that source and kind.
        time: when it was sent, on the sender's clock [s].
        instance: differs from one start of the source to the next, and each counts for itself; left
            out, a count that begins anew is believed after a few messages.
    """

    source: Name
    sequence: Number
    time: float
    instance: Instance = ""


class StopObservation(RobotObservation, frozen=True):
    """One stop with full braking, measured by somebody else.

    Attributes:
        speed: at the stop command [m/s]. grade: of the ground, uphill positive [rad].
        deceleration: mean, from brake onset to rest [m/s²]. deceleration_std: of its measurement.
        dead_time: from command to onset [s]. distance: from command to rest [m].
        surface: its name as in map and model; empty where nobody knows.
    """

    speed: Annotated[float, Meta(gt=0.0, le=50.0)]
    grade: Annotated[float, Meta(ge=-0.8, le=0.8)]
    deceleration: Annotated[float, Meta(gt=0.0, le=20.0)]
    deceleration_std: Std = 0.0
    dead_time: Annotated[float, Meta(ge=0.0, le=10.0)] | None = None
    distance: Positive | None = None
    surface: Surface = ""


class DriveSamples(RobotObservation, frozen=True):
    """Samples of a drive, in the order of time, next to those of the message before.

    `v` is the speed over ground, and `v_cmd` 0 the command to brake as hard as the brakes can:
    locked wheels would teach too much of the brakes, gentle stops too little.

    Attributes:
        columns: names of the rows. values: (rows, n), all finite; what is not measured is no row.
        surface: what the samples were driven on; empty where nobody knows.
    """

    columns: Annotated[list[Text], Meta(min_length=4, max_length=16)]
    values: np.ndarray
    surface: Surface = ""


class TerrainLabel(RobotObservation, frozen=True):
    """What an estimator on board takes the ground now to be.

    Attributes:
        surface: its name as in map and model. probability: that it is right.
    """

    surface: Annotated[str, Meta(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_-]+$")]
    probability: Probability = 1.0


class Receipt(Message, frozen=True):
    """What became of an observation that was sent as a query.

    Attributes:
        status: `taken`, `ignored` (seen before, or older), `refused` or `error`. reason: in words.
        version: of the parameters afterwards. durable: they are on disk.
    """

    status: str
    reason: str
    version: int
    durable: bool
