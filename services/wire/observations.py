"""Observations of robots and their estimators: stops, drive samples, labels of the terrain.

SI units, angles in radians. Each sender numbers its messages of each kind, and stamps them with its
clock, whose zero is arbitrary.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from slopewise.services.wire.plan_messages import Instance, Message, Name, Number, Text

Surface = Annotated[str, Meta(max_length=40, pattern=r"^[A-Za-z0-9_-]*$")]
Positive = Annotated[float, Meta(gt=0.0)]
Probability = Annotated[float, Meta(ge=0.0, le=1.0)]
Std = Annotated[float, Meta(ge=0.0, le=10.0)]

DRIVE_COLUMNS = ("t", "v", "v_cmd", "pitch")
"""Columns that drive samples must have, as in a drive log."""

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
"""Optional columns; `grade` is that of the terrain, from a map."""


class RobotObservation(Message, frozen=True, kw_only=True):
    """Fields of every observation.

    Attributes:
        source: name of the sender. sequence: number that increases with every message of a kind.
        time: time of sending, on the sender's clock [s].
        instance: text that differs between starts of the sender; each instance has a separate
            count. If omitted, a restarted count is accepted after a few messages.
    """

    source: Name
    sequence: Number
    time: float
    instance: Instance = ""


class StopObservation(RobotObservation, frozen=True):
    """One stop with full braking, measured by the sender.

    Attributes:
        speed: speed at the stop command [m/s]. grade: slope of the terrain, uphill positive [rad].
        deceleration: mean from brake onset to rest [m/s²].
        deceleration_std: standard deviation of its measurement [m/s²].
        dead_time: time from command to onset [s]. distance: from command to rest [m].
        surface: its name as in map and model; empty if unknown.
    """

    speed: Annotated[float, Meta(gt=0.0, le=50.0)]
    grade: Annotated[float, Meta(ge=-0.8, le=0.8)]
    deceleration: Annotated[float, Meta(gt=0.0, le=20.0)]
    deceleration_std: Std = 0.0
    dead_time: Annotated[float, Meta(ge=0.0, le=10.0)] | None = None
    distance: Positive | None = None
    surface: Surface = ""


class DriveSamples(RobotObservation, frozen=True):
    """Samples of a drive in chronological order, continuing those of the message before.

    `v` is the speed over ground, and `v_cmd` 0 the command to brake with full force: locked wheels
    would indicate too much braking force, gentle stops too little.

    Attributes:
        columns: names of the rows. values: (rows, n), all finite; unmeasured columns are omitted.
        surface: on which the samples were driven; empty if unknown.
    """

    columns: Annotated[list[Text], Meta(min_length=4, max_length=16)]
    values: np.ndarray
    surface: Surface = ""


class TerrainLabel(RobotObservation, frozen=True):
    """Surface under the vehicle now, as estimated on board.

    Attributes:
        surface: its name as in map and model. probability: that the label is correct [1].
    """

    surface: Annotated[str, Meta(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_-]+$")]
    probability: Probability = 1.0


class ObservationAck(Message, frozen=True):
    """Reply to an observation that was sent as a query; its schema is called ``receipt``.

    Attributes:
        status: `taken`, `ignored` (duplicate, or older), `refused` or `error`. reason: as text.
        version: parameter version afterwards. durable: the change is on disk.
    """

    SCHEMA: ClassVar[str] = "receipt"

    status: str
    reason: str
    version: int
    durable: bool
