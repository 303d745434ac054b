"""Messages about plans and maps; SI units, angles in radians, coordinates of the map.

Arrays are float64: (n, 2) is n rows of two. Terms are explained in docs/nomenclature.md.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

import msgspec
import numpy as np
from msgspec import Meta

Name = Annotated[str, Meta(min_length=1, max_length=120)]
Text = Annotated[str, Meta(max_length=120)]
ClassNames = Annotated[list[Text], Meta(min_length=1, max_length=62)]
Number = Annotated[int, Meta(ge=0, le=2**53)]
Instance = Annotated[str, Meta(max_length=64, pattern=r"^[!-~]*$")]
NotNegative = Annotated[float, Meta(ge=0.0)]

BUSY = "busy"
ERROR = "error"
"""Statuses of a reply without a plan: no time for the request; the request is not usable."""

PLAN_COLUMNS = (
    "station",
    "x",
    "y",
    "z",
    "grade",
    "roll",
    "curvature",
    "speed",
    "accel",
    "time",
    "speed_bound",
    "stop_distance",
    "rear_load",
    "side_load",
)
"""Rows of a plan's values, in order."""


class Message(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of all messages: no field may be missing, and none may be unknown."""


class Path(Message, frozen=True):
    """One candidate path."""

    name: Name  # unique within the request
    points: np.ndarray  # x, y of at least three points, each unlike the one before [m], (n, 2)
    speed_limit: np.ndarray | None = None  # limit along the path [m/s], (n,)
    clear: float | None = None  # station up to which it is free [m]; null: as in the request


class PlanRequest(Message, frozen=True):
    """Request for plans.

    The service remembers and continues the plan of a named client; without a name each request is
    independent, and each path begins at the vehicle.
    """

    speed: float  # vehicle speed along its heading [m/s]
    paths: list[Path]  # candidates
    client: Text = ""  # name of the client
    pose: tuple[float, float, float] | None = None  # x, y, heading [m, m, rad]; of a named client
    pose_age: NotNegative = 0.0  # time since pose and speed were measured, with its transport [s]
    clear: NotNegative | None = None  # station up to which paths are free [m]; null: to the end
    sequence: Number = 0  # number that is returned in the reply
    session_time: NotNegative = 0.0  # time since the start of the drive [s], for effects
    brake_heat: NotNegative = 0.0  # heat in the brakes by vehicle mass [J/kg], likewise


class Parameters(Message, frozen=True):
    """Parameters with which a plan was made."""

    version: int  # number that increases with every change
    name: str  # model name
    fingerprint: str  # digest of the vehicle's data
    age: float  # time since they were applied [s]
    model_hash: str = ""  # SHA-256 of the model file that would hold them, as of `sha256sum`


class WireCommand(Message, frozen=True):
    """Command until the next reply."""

    speed: float  # speed to reach within a period [m/s]
    accel: float  # acceleration to that speed [m/s²]
    stop: bool  # brake with full force
    valid_for: float  # time for which the plan may be followed [s]


class RankedCandidate(Message, frozen=True):
    """Result of one candidate."""

    name: str
    usable: bool
    reason: str
    cost: float | None = None  # ranking cost [s], null where it was not planned


class Limit(Message, frozen=True):
    """Limiting bound ``name`` from station number ``first`` up to the next of these."""

    first: int  # number of its first station, from 0
    name: str  # of the bound


class ObstacleMessage(Message, frozen=True):
    """Obstacle that body or wheels must not reach."""

    bound: str  # name of the limiting bound
    x: float  # x, y, height: position and height [m]
    y: float
    height: float
    words: str  # kind, position and limit, as text; words: ok


class Deviation(Message, frozen=True):
    """Largest distance of a plan from the given path, in plan view."""

    largest: float  # that distance [m]
    station: float  # station, x, y: where on the plan [m]
    x: float
    y: float
    limit: float  # largest permitted distance [m]


class Plan(Message, frozen=True):
    """One plan of N stations."""

    candidate: str
    status: str  # ok, blocked, infeasible or degraded
    reason: str  # its explanation with numbers
    travel_time: float  # duration [s]
    progress: float  # station where it comes to rest [m]
    clear_distance: float  # station before which every emergency stop ends [m]
    least_margin: float | None  # their smallest margin to it [m], null at rest; words: ok
    least_rear_load: float  # their lowest rear load, of the level static load [1]; words: ok
    limits: list[Limit]  # limiting bounds, one entry for each change
    columns: list[str]  # names of the rows of values
    values: np.ndarray  # (rows, N)
    obstacle: ObstacleMessage | None = None  # it ends the clear distance
    path_deviation: Deviation | None = None  # deviation from the given path

    def column(self, name: str) -> np.ndarray:
        """One row of the values, (N,)."""
        row: np.ndarray = self.values[self.columns.index(name)]
        return row


class PlanReply(Message, frozen=True):
    """Reply to one plan request; there is always one.

    The hash of a map changes with each patch: it is of the hash before and the cells of the patch.
    """

    status: str  # that of the chosen plan, or `busy` or `error`, which have no plans
    reason: str  # its explanation
    service: str  # id of the service
    sequence: int = 0  # that of the request
    parameters: Parameters | None = None  # with which the plans were made
    map_version: int = 0  # version of the map
    map_age: float | None = None  # its age [s]
    command: WireCommand | None = None  # command to follow now; null without a plan
    chosen: str | None = None  # name of the candidate to drive; null: stop
    kept: bool = False  # the plan driven so far is continued unchanged; words: ok
    ranking: list[RankedCandidate] = []  # all candidates, best first
    plans: list[Plan] = []  # finished plans, best first
    flags: list[str] = []  # warnings as text
    seconds: dict[str, float] = {}  # duration of each stage [s]; `planner` is all of planning
    map_id: str = ""  # source and number of the last map update
    map_hash: str = ""  # SHA-256 of the map's cells


class MapUpdate(Message, frozen=True):
    """Elevation map, whole or a patch of it.

    Without ``time`` the delay of an update is not part of the map's age. Each ``instance`` of a
    source has a separate count; without one, a restarted count is accepted after a few maps.
    """

    source: Name  # name of the mapper
    sequence: Number  # number that increases with every update of it
    elevation: np.ndarray  # heights (rows, columns) [m], row 0 at minimum y; NaN (null) is unknown
    resolution: Annotated[float, Meta(gt=0.0)]  # edge of a cell [m]
    origin: tuple[float, float]  # x, y of the centre of cell [0, 0] [m]
    patch: bool = False  # these cells only, on the grid of the known whole map
    terrain_class: np.ndarray | None = None  # index in class_names (rows, columns), 0 is the base
    class_names: ClassNames | None = None  # names of the classes, the empty one for the base
    height_std: NotNegative | None = None  # relative error of heights [m]; null: as is typical
    correlation_length: NotNegative | None = None  # over which errors are alike [m]; null: none
    time: float | None = None  # of measurement, on the source's clock, whose zero is arbitrary [s]
    instance: Instance = ""  # text that differs between starts of the source


class ServiceStatus(Message, frozen=True):
    """State of the service; on the wire its schema is called ``status``."""

    SCHEMA: ClassVar[str] = "status"

    service: str  # its id
    uptime: float  # time since its start [s]
    parameters: Parameters  # parameters, map_version, map_age: as in a reply
    map_version: int
    map_age: float | None
    flags: list[str]  # warnings
    counters: dict[str, int]  # event counts since the start
    seconds: dict[
        str, float
    ]  # median and 99th percentile of recent times from arrival to reply [s]
    degraded: list[str] = []  # reasons for slower plans than by default
    instance: str = ""  # text that differs between processes
