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
UpToTen = Annotated[float, Meta(ge=0.0, le=10.0)]

MAX_SAMPLES = 20_000  # samples of one message [1]: 100 s at 200 Hz
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

    Each ``instance`` of a sender has a separate count; without one, a restarted count is accepted
    after a few messages.
    """

    source: Name  # name of the sender
    sequence: Number  # number that increases with every message of a kind
    time: float  # time of sending, on the sender's clock [s]
    instance: Instance = ""  # text that differs between starts of the sender


class StopObservation(RobotObservation, frozen=True):
    """One stop with full braking, measured by the sender."""

    speed: Annotated[float, Meta(gt=0.0, le=50.0)]  # speed at the stop command [m/s]
    grade: Annotated[float, Meta(ge=-0.8, le=0.8)]  # slope of the terrain, uphill positive [rad]
    deceleration: Annotated[float, Meta(gt=0.0, le=20.0)]  # mean from brake onset to rest [m/s²]
    deceleration_std: UpToTen = 0.0  # standard deviation of its measurement [m/s²]
    dead_time: UpToTen | None = None  # time from command to onset [s]
    distance: Annotated[float, Meta(gt=0.0)] | None = None  # from command to rest [m]
    surface: Surface = ""  # its name as in map and model; empty if unknown


class DriveSamples(RobotObservation, frozen=True):
    """Samples of a drive in chronological order, continuing those of the message before.

    `v` is the speed over ground, and `v_cmd` 0 the command to brake with full force: locked wheels
    would indicate too much braking force, gentle stops too little.
    """

    columns: Annotated[list[Text], Meta(min_length=4, max_length=16)]  # names of the rows
    values: np.ndarray  # (rows, n), all finite; unmeasured columns are omitted
    surface: Surface = ""  # on which the samples were driven; empty if unknown


class TerrainLabel(RobotObservation, frozen=True):
    """Surface under the vehicle now, as estimated on board."""

    surface: Annotated[str, Meta(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_-]+$")]
    probability: Annotated[float, Meta(ge=0.0, le=1.0)] = 1.0  # that the label is correct [1]


class ObservationAck(Message, frozen=True):
    """Reply to an observation that was sent as a query; its schema is called ``receipt``."""

    SCHEMA: ClassVar[str] = "receipt"

    status: str  # `taken`, `ignored` (duplicate, or older), `refused` or `error`
    reason: str  # as text
    version: int  # parameter version afterwards
    durable: bool  # the change is on disk
