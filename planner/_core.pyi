"""The compiled core; `planner/core/` has its sources."""

from slopewise.models.arrays import Floats

DIGEST: str
ROWS: tuple[tuple[str, str, str, str], ...]
STANDSTILL_SQ: float
TIGHTENING: float
MIN_STATIONS: int
NO_PROFILE: int
KIND_COUNT: int

def time_optimal(
    station: Floats,
    speed_sq_max: Floats,
    sin_grade: Floats,
    force_lower_slope: Floats,
    force_lower_intercept: Floats,
    trained_speed_min: Floats,
    accel_max: Floats,
    required_thrust_ratio: Floats,
    start_sq: Floats,
    decel: float,
    specific_power: float,
    speed_sq: Floats,
    reachable_start_sq: Floats,
) -> None: ...
def travel_cost(
    station: Floats, speed_sq: Floats, horizon_penalty: float, cost: Floats
) -> None: ...
def smooth(
    ds: Floats,
    speed_sq_max: Floats,
    accel_max: Floats,
    decel_max: Floats,
    jerk: float,
    start_accel: float,
    speed_sq: Floats,
) -> int: ...
def smoothing_program(
    ds: Floats,
    speed_sq_max: Floats,
    accel_max: Floats,
    decel_max: Floats,
    jerk: float,
    start_accel: float,
    open: Floats,  # noqa: A002
    rows: Floats,
    limit: Floats,
) -> None: ...
def keep_inside(speed_sq: Floats, speed_sq_max: Floats, out: Floats) -> None: ...
