"""The compiled core; `planner/core/` has its sources."""

from slopewise.models.arrays import Bools, Floats, Ints, Singles
from slopewise.models.averaging_windows import AveragingWindows
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.surfaces import SurfaceCache
from slopewise.planner.ground.terrain_profile import BodyRows, TerrainProfile
from slopewise.planner.planning_limits import PlanningLimits
from slopewise.planner.profile.problems import ProfileProblem, SmoothingProblem
from slopewise.planner.swept.hazards import Hazards

DIGEST: str
STANDSTILL_SQ: float
TIGHTENING: float
MIN_STATIONS: int
NO_PROFILE: int
KIND_COUNT: int
STOP_GUARD: float
HOLDING: float
MOTION_LAWS: str
SLOPE_MARGIN: float

class HeightGrid:
    memory: int
    def __init__(
        self,
        elevation: Floats,
        origin_x: float,
        origin_y: float,
        resolution: float,
        half_length: float,
        half_width: float,
        radius: float,
    ) -> None: ...
    def tyre_lifts(self, heading: int) -> Floats: ...
    def sample_ground(
        self,
        x: Floats,
        y: Floats,
        count: Ints,
        centre_offset: float,
        body_offset: float,
        length: float,
        width: float,
        heading: tuple[Floats, Floats] | None = None,
    ) -> tuple[Floats, Bools, Singles, Singles]: ...

class BroadPhase:
    def __init__(
        self,
        elevation: Floats,
        origin_x: float,
        origin_y: float,
        resolution: float,
        sizes: object,
        band: tuple[float, float, float] | None,
        x: Floats,
        y: Floats,
        beside: float,
    ) -> None: ...
    def widened(self, sizes: object, band: tuple[float, float, float]) -> BroadPhase: ...
    def covers(self, x: Floats, y: Floats) -> bool: ...
    def sweep(
        self,
        body: BodyRows,
        profile: TerrainProfile,
        spacing: float,
        across: Floats | None,
        code_of_kind: Ints,
    ) -> tuple[Ints, Floats, int]: ...
    def suspect_all(self) -> None: ...

def roughness_speeds(
    grid: HeightGrid,
    profile: TerrainProfile,
    spacing: Floats,
    sizes: object,
    limits: tuple[float, float, float, float, float, float],
) -> Floats: ...
def time_optimal(problem: ProfileProblem) -> tuple[Floats, Floats]:
    """Fastest profile under the bounds, v² (N, M) [m²/s²].

    And (M,) the highest v² at the first station from which the bounds can still be kept; below
    ``start_sq`` the profile begins there nevertheless [m²/s²].
    """

def average_heights(
    elevation: Floats,
    windows: AveragingWindows,
    noise: float,
    significance: float,
    known_share: float,
) -> Floats: ...
def travel_cost(station: Floats, speed_sq: Floats, horizon_penalty: float) -> Floats:
    """Travel time, and this charge [s/m] for each metre on which nothing moves, (M,) [s]."""

def smooth(problem: SmoothingProblem) -> tuple[int, Floats]: ...
def smoothing_program(problem: SmoothingProblem) -> tuple[Floats, Floats, Floats]: ...
def keep_inside(speed_sq: Floats, speed_sq_max: Floats) -> Floats: ...

# Forces and bounds along candidates.
def surface_bits(
    classes: Ints,
    origin_x: float,
    origin_y: float,
    per_metre: float,
    body: BodyRows,
    half_length: float,
    half_width: float,
) -> Ints: ...
def braking_forces(
    profile: TerrainProfile,
    surfaces: SurfaceCache,
    margin: float,
    least_term: Floats | None,
    most_term: Floats | None,
    drag: Floats | None,
) -> tuple[Floats, Bools, Floats]: ...
def speed_bounds(
    profile: TerrainProfile,
    ground: BrakingGround,
    hazards: Hazards,
    speed_limit: Floats | None,
    clear: Floats,
    vehicle: PlanningLimits,
    curves: Floats | None,
) -> tuple[Floats, Ints, Ints, Ints, Floats]: ...

# Verification and labels; `terms` is a `Terms`, `limits` a `PlanningLimits`, `track` a `Track`.
def copy_track(
    profile: TerrainProfile, ground: BrakingGround, speed_limit: Floats, candidate: int, first: int
) -> Floats: ...
def verify(
    track: tuple[Floats, ...],
    even: tuple[Floats, ...],
    speed_sq: Floats,
    clear_distance: float,
    distance_offset: float,
    beyond: int,
    terms: object,
) -> tuple[Floats, Floats, Ints]: ...
def raise_held(
    track: tuple[Floats, ...],
    speed_sq: Floats,
    bound: Floats,
    clear_distance: float,
    distance_offset: float,
    beyond: int,
    steps: int,
    terms: object,
) -> tuple[Floats, Ints]: ...
def verify_batch(
    profile: TerrainProfile,
    ground: BrakingGround,
    speed_limit: Floats,
    speed_sq: Floats,
    clear_distance: Floats,
    terms: object,
    lanes: Ints,
) -> Floats: ...
def first_blocked(
    elevation: Floats,
    origin_x: float,
    origin_y: float,
    resolution: float,
    sizes: object,
    profile: TerrainProfile,
    ground: BrakingGround,
    candidate: int,
    limits: tuple[float, ...],
    first: int,
    end: float,
) -> tuple[int, float, float, float, float]: ...
def segment_limits(
    track: tuple[Floats, ...], speed_sq: Floats, problem: ProfileProblem, limits: object
) -> tuple[Floats, Floats]: ...
def motion(station: Floats, speed_sq: Floats) -> tuple[Floats, Floats]:
    """Acceleration, 0 at the last station [m/s²], and time, constant once the profile rests [s]."""

def labels(
    speed_sq: Floats,
    accel: Floats,
    bound: Floats,
    bound_label: Ints,
    accel_max: Floats,
    decel_max: Floats,
    most_accel: float,
    smoothed: bool,
) -> Ints: ...

# Paths of a moving horizon.
def feet_on_line(
    line_x: Floats, line_y: Floats, x: Floats, y: Floats, low: int, high: int
) -> tuple[Ints, Floats, Floats]: ...
def locate_on_paths(
    x: Floats, y: Floats, count: Ints, at_x: float, at_y: float, heading: float
) -> tuple[Ints, Floats]: ...
def deviation(given: Floats, line: Floats, part: tuple[float, float] | None = None) -> Floats: ...
def first_turn(points: Floats, reach: float, angle: float) -> int: ...
def third_difference(points: Floats) -> float: ...
def group_points(points: Floats, reach: float) -> tuple[int, Ints]: ...
def usual_step(along: Floats) -> float: ...
def first_cusp(points: Floats, angle: float, shortest: float) -> int: ...
def dense_places(
    points: Floats, along: Floats, stray: float
) -> tuple[int, Floats, Floats, Floats]: ...
def spline_stations(
    knots: Floats,
    x: Floats,
    y: Floats,
    degree: int,
    length: float,
    first: Floats,
    last: Floats,
    count: int,
) -> Floats: ...

class FollowedLine:
    length: float
    sharpest: float
    def __init__(self, points: Floats, half: float) -> None: ...
    def stations(self, count: int) -> tuple[Floats, Floats]: ...
    def curvature(self, place: Floats) -> Floats: ...
    def sharper_than(
        self, even: Floats, felt: float, limiting: float, noise: float
    ) -> Floats | None: ...
