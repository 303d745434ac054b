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
    """One candidate path.

    Attributes:
        name: unique within the request.
        points: x, y of at least three points, each different from the one before [m], (n, 2).
        speed_limit: limit along the path [m/s], (n,).
        clear: station up to which the path is known to be free [m]; None: as in the request.
    """

    name: Name
    points: np.ndarray
    speed_limit: np.ndarray | None = None
    clear: float | None = None


class PlanRequest(Message, frozen=True):
    """Request for plans.

    Attributes:
        speed: vehicle speed along its heading [m/s].
        paths: candidates.
        client: name of the client. The service remembers and continues the plan of a named
            client; without a name each request is independent, and each path begins at the vehicle.
        pose: x, y, heading of the vehicle [m, m, rad]; required for a named client.
        clear: station up to which paths are known to be free [m]; None: to the end of each path.
        sequence: number that is returned in the reply.
        session_time: time since the start of the drive [s], for effects that depend on it.
        brake_heat: heat in the brakes by vehicle mass [J/kg], likewise.
    """

    speed: float
    paths: list[Path]
    client: Text = ""
    pose: tuple[float, float, float] | None = None
    clear: NotNegative | None = None
    sequence: Number = 0
    session_time: NotNegative = 0.0
    brake_heat: NotNegative = 0.0


class Parameters(Message, frozen=True):
    """Parameters with which a plan was made.

    Attributes:
        version: number that increases with every change. name: model name.
        fingerprint: digest of the vehicle's data. age: time since they were applied [s].
        model_hash: SHA-256 of the model file that would hold them, as of `sha256sum`.
    """

    version: int
    name: str
    fingerprint: str
    age: float
    model_hash: str = ""


class WireCommand(Message, frozen=True):
    """Command until the next reply.

    Attributes:
        speed: speed to reach within a period [m/s]. accel: acceleration to that speed [m/s²].
        stop: brake with full force. valid_for: time for which the plan may be followed [s].
    """

    speed: float
    accel: float
    stop: bool
    valid_for: float


class RankedCandidate(Message, frozen=True):
    """Result of one candidate. ``cost`` [s] is None where it was not planned."""

    name: str
    usable: bool
    reason: str
    cost: float | None = None


class Limit(Message, frozen=True):
    """Limiting bound ``name`` from station number ``first`` up to the next of these."""

    first: int
    name: str


class ObstacleMessage(Message, frozen=True):
    """Obstacle that body or wheels must not reach.

    Attributes:
        bound: name of the limiting bound. x, y, height: position and height [m].
        words: kind, position and limit, as text.
    """

    bound: str
    x: float
    y: float
    height: float
    words: str  # words: ok


class Deviation(Message, frozen=True):
    """Largest distance of a plan from the given path, in plan view.

    Attributes:
        largest: that distance [m]. station, x, y: where on the plan [m].
        limit: largest permitted distance [m].
    """

    largest: float
    station: float
    x: float
    y: float
    limit: float


class Plan(Message, frozen=True):
    """One plan of N stations.

    Attributes:
        status: ok, blocked, infeasible or degraded. reason: its explanation with numbers.
        travel_time: duration [s]. progress: station where it comes to rest [m].
        clear_distance: station before which every emergency stop ends [m].
        least_margin: smallest margin of these stops to it [m], None at rest.
        least_rear_load: lowest rear load of these stops, as a share of the level static load [1].
        limits: limiting bounds, one entry for each change.
        columns: names of the rows of values. values: (rows, N).
        obstacle: the obstacle that ends the clear distance, if there is one.
        path_deviation: deviation from the given path.
    """

    candidate: str
    status: str
    reason: str
    travel_time: float
    progress: float
    clear_distance: float
    least_margin: float | None  # words: ok
    least_rear_load: float  # words: ok
    limits: list[Limit]
    columns: list[str]
    values: np.ndarray
    obstacle: ObstacleMessage | None = None
    path_deviation: Deviation | None = None

    def column(self, name: str) -> np.ndarray:
        """One row of the values, (N,)."""
        row: np.ndarray = self.values[self.columns.index(name)]
        return row


class PlanReply(Message, frozen=True):
    """Reply to one plan request; there is always one.

    Attributes:
        status: that of the chosen plan, or `busy`, or `error`; the latter two have no plans.
        reason: its explanation. service: id of the service. sequence: that of the request.
        parameters: with which the plans were made. map_version: version of the map.
        map_age: its age [s].
        map_id: source and number of the last map update. map_hash: SHA-256 of a whole map's cells;
            with each patch, of the hash before it and the cells of the patch.
        command: command to follow now; None if the reply has no plan.
        chosen: name of the candidate to drive; None: stop.
        kept: the plan driven so far is continued unchanged.
        ranking: all candidates, best first. plans: finished plans, best first.
        flags: warnings as text.
        seconds: duration of each stage [s]; `planner` is all of planning.
    """

    status: str
    reason: str
    service: str
    sequence: int = 0
    parameters: Parameters | None = None
    map_version: int = 0
    map_age: float | None = None
    command: WireCommand | None = None
    chosen: str | None = None
    kept: bool = False  # words: ok
    ranking: list[RankedCandidate] = []
    plans: list[Plan] = []
    flags: list[str] = []
    seconds: dict[str, float] = {}
    map_id: str = ""
    map_hash: str = ""


class MapUpdate(Message, frozen=True):
    """Elevation map, whole or a patch of it.

    Attributes:
        source: name of the mapper. sequence: number that increases with every update of it.
        elevation: heights (rows, columns) [m], row 0 at minimum y; NaN (null) is unknown terrain.
        resolution: edge of a cell [m]. origin: x, y of the centre of cell [0, 0] [m].
        patch: these cells only, on the grid of the known whole map.
        terrain_class: whole numbers into class_names (rows, columns), 0 is the base surface.
        height_std: relative error of the heights [m]; if omitted, that of a typical map of a robot,
            or that of the whole map.
        time: time of measurement on the source's clock, whose zero is arbitrary [s]; if omitted,
            the delay of the update is not included in the map's age.
        instance: text that differs between starts of the source; each instance has a separate
            count. If omitted, a restarted count is accepted after a few maps.
    """

    source: Name
    sequence: Number
    elevation: np.ndarray
    resolution: Annotated[float, Meta(gt=0.0)]
    origin: tuple[float, float]
    patch: bool = False
    terrain_class: np.ndarray | None = None
    class_names: Annotated[list[Text], Meta(min_length=1, max_length=62)] | None = None
    height_std: Annotated[float, Meta(ge=0.0)] | None = None
    time: float | None = None
    instance: Instance = ""


class ServiceStatus(Message, frozen=True):
    """State of the service; on the wire its schema is called ``status``.

    Attributes:
        service: its id. uptime: time since its start [s].
        parameters, map_version, map_age: as in a reply.
        flags: warnings. degraded: reasons for slower plans than usual.
        counters: event counts since the start. instance: text that differs between processes.
        seconds: median and 99th percentile of recent replies, from arrival to reply [s].
    """

    SCHEMA: ClassVar[str] = "status"

    service: str
    uptime: float
    parameters: Parameters
    map_version: int
    map_age: float | None
    flags: list[str]
    counters: dict[str, int]
    seconds: dict[str, float]
    degraded: list[str] = []
    instance: str = ""
