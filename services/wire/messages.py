"""What travels between robot and service; SI units, angles in radians, the map's coordinates.

Arrays are float64: (n, 2) is n rows of two. What each word means is in docs/nomenclature.md.
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
"""Statuses of a reply beside those of a plan: no time for it; the request cannot be used."""

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
    """What all messages have: no field may be missing, and none may be unknown."""


class Path(Message, frozen=True):
    """One candidate.

    Attributes:
        name: unique within the request.
        points: (n, 2) of x, y, at least three, none the same as the one before [m].
        speed_limit: (n,) of the path itself [m/s].
        clear: station up to which the way is known free [m]; None: as in the request.
    """

    name: Name
    points: np.ndarray
    speed_limit: np.ndarray | None = None
    clear: float | None = None


class PlanRequest(Message, frozen=True):
    """A question for plans.

    Attributes:
        speed: of the vehicle, along its heading [m/s].
        paths: candidates.
        client: who asks. Named, the service remembers what it drives, and goes on with it; without
            a name each question stands alone, and each path begins at the vehicle.
        pose: x, y, heading of the vehicle [m, m, rad]; a named client has to give it.
        clear: station up to which the way is known free [m]; None: to the end of each path.
        sequence: comes back in the reply.
        session_time, brake_heat: [s], [J/kg] for the effects that depend on them.
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
    """Which parameters a plan was made with.

    Attributes:
        version: grows with every change. name: of the model. fingerprint: of the vehicle.
        age: since they were taken up [s].
        model_hash: SHA-256 of the model file that would hold them, as `sha256sum` tells it.
    """

    version: int
    name: str
    fingerprint: str
    age: float
    model_hash: str = ""


class WireCommand(Message, frozen=True):
    """What to do until the next answer: reach ``speed`` [m/s] within a period at ``accel`` [m/s²];
    ``stop``: brake as hard as the brakes can. The plan may be followed for ``valid_for`` [s].
    """

    speed: float
    accel: float
    stop: bool
    valid_for: float


class RankedCandidate(Message, frozen=True):
    """How one candidate fared. ``cost`` [s] is None where it was not planned."""

    name: str
    usable: bool
    reason: str
    cost: float | None = None


class Limit(Message, frozen=True):
    """From station number ``first`` on, up to the next of these, ``name`` limits the speed."""

    first: int
    name: str


class Met(Message, frozen=True):
    """What body or wheels must not come to.

    Attributes:
        bound: name of the bound that it counts as. x, y, height: where and how high it is [m].
        words: what, where, against which limit.
    """

    bound: str
    x: float
    y: float
    height: float
    words: str


class Deviation(Message, frozen=True):
    """How far a plan leads from the path that was given, in the plan view.

    Attributes:
        largest: [m]. station, x, y: where on the plan [m]. limit: that it keeps [m].
    """

    largest: float
    station: float
    x: float
    y: float
    limit: float


class Plan(Message, frozen=True):
    """One plan of N stations.

    Attributes:
        status, reason: ok, blocked, infeasible or degraded; what, where, by how much.
        travel_time: [s]. progress: station where it comes to rest [m].
        clear_distance: station before which every emergency stop ends [m].
        least_margin: what the tightest one leaves of it [m], None at rest.
        least_rear_load: of all emergency stops, as a share of the level static load.
        limits: what limits the speed, a change an entry.
        columns: names of the rows of values. values: (rows, N).
        obstacle: what ends the clear distance, if body or wheels must not come to it.
        path_deviation: from the given path.
    """

    candidate: str
    status: str
    reason: str
    travel_time: float
    progress: float
    clear_distance: float
    least_margin: float | None
    least_rear_load: float
    limits: list[Limit]
    columns: list[str]
    values: np.ndarray
    obstacle: Met | None = None
    path_deviation: Deviation | None = None

    def column(self, name: str) -> np.ndarray:
        """One row of the values, (N,)."""
        row: np.ndarray = self.values[self.columns.index(name)]
        return row


class PlanReply(Message, frozen=True):
    """The answer to one question; there is always one.

    Attributes:
        status, reason: those of the chosen plan, or `busy`, or `error`; then there are no plans.
        service, sequence: who answers, and to which question.
        parameters, map_version, map_age: what the plans were made from; age in s.
        map_id: who sent the ground last, with its number. map_hash: SHA-256 of a whole map's cells,
            and with each patch of the hash so far and the cells of the patch.
        command: what to do now; None if this answer is none.
        chosen: name of the candidate to drive, None where there is nothing to drive along.
        kept: the plan driven so far is driven on as it is.
        ranking: all candidates, best first. plans: those that were finished, best first.
        flags: what is not as it should be, in words.
        seconds: what took how long; `planner` is all of planning.
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
    kept: bool = False
    ranking: list[RankedCandidate] = []
    plans: list[Plan] = []
    flags: list[str] = []
    seconds: dict[str, float] = {}
    map_id: str = ""
    map_hash: str = ""


class MapUpdate(Message, frozen=True):
    """Ground, whole or a patch of it.

    Attributes:
        source: who saw it. sequence: grows with every update of that source.
        elevation: (rows, columns) [m], row 0 at minimum y; NaN (null) is unknown ground.
        resolution: edge of a cell [m]. origin: x, y of the centre of cell [0, 0] [m].
        patch: these cells only, on the grid of the whole map that is known already.
        terrain_class: (rows, columns) whole numbers into class_names, 0 is the base surface.
        height_std: how far heights are off against each other [m]; left out, what a robot's own map
            may be off, or what the whole map has been off so far.
        time: when the ground was seen, on the source's clock, which may begin anywhere [s]; left
            out, a map that was long on its way counts as new.
        instance: differs from one start of the source to the next, and each counts for itself; left
            out, a count that begins anew is believed after a few maps.
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
    """How the service is; on the wire its schema is called ``status``.

    Attributes:
        service: its id. uptime: [s]. parameters, map_version, map_age: as in a reply.
        flags: what is not as it should be. degraded: why plans are slower than they need be.
        counters: since the start. instance: differs from one process to the next.
        seconds: median and 99th percentile of late answers, from arrival to reply [s].
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
