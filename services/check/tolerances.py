"""How far beyond a limit something has to be before it is a violation, and why."""

from __future__ import annotations

from typing import NamedTuple


class Tolerance(NamedTuple):
    """By how much a limit may be passed."""

    value: float  # in ``unit``
    unit: str
    meaning: str  # half a sentence about the kind of violation
    rationale: str  # origin of the value


_TABLE = """\
speed_limit | 0.002 | m/s | faster than vehicle, path or trained range allow | rounding in files
stopping_path | 0.01 | m | an emergency stop ends beyond the clear distance | grade between rows \
is sampled here, and taken to be linear by plans
unknown_terrain | 0.01 | m | the vehicle is, or comes to rest, where ground is unknown | as of \
stopping_path; 1 m stands for being there
model_validity | 0.01 | m | the vehicle is, or comes to rest, on slopes that the model was not \
trained on | as of stopping_path; 1 m stands for being there, from 0.6° beyond the range on
tip_over | 0.01 | 1 | an axle loses too much load | slopes between rows
rollover | 0.015 | 1 | a side or a wheel loses too much load | slopes and turns between rows
crest | 0.02 | 1 | over a crest an axle, side or wheel loses too much load | vertical curvature \
is a second derivative of the map's heights
dip | 0.1 | share | vertical acceleration of the body in a dip | as of crest
lateral | 0.05 | share | lateral acceleration in a turn, its bank counted in | curvature of rows \
that are rounded, and banks between rows
wheel_speed | 0.01 | share | the outer wheels turn too fast | as of lateral
accel | 0.02 | m/s² | speeds up more than the limit | rounding of speeds
traction | 0.05 | m/s² | speeds up, or climbs, more than the drive can | slopes between rows
decel | 0.05 | m/s² | slows down more than the limit or the brakes allow | slopes between rows
friction | 0.02 | share | slope, turn and drive or brakes ask for more than friction gives | \
curvature and slopes between rows
holding | 0.01 | 1 | comes to rest where brakes or friction do not hold it | slopes between rows
step | 0.1 | share | a wheel meets a step, a drop or a hole that is too high | heights between \
cells are a ramp, its middle is not sharp
clearance | 0.1 | share | the ground between the wheels reaches the underside | as of step
body | 0.1 | share | the body strikes ground ahead of, behind or beside the wheels | as of step
turning | 0.05 | share | turns tighter than the steering can | curvature of rows that are rounded
steering_rate | 0.05 | share | turns begin faster than the steering follows | as of turning
stop_distance | 0.02 | m | the plan's own stopping distance is not what the model gives | beyond \
2.5 % of it: where brakes slow down little, the grade between rows matters
rear_load | 0.03 | 1 | the plan reports another rear load than the stop leaves | slopes between \
rows
side_load | 0.03 | 1 | the plan reports another side load than the stop leaves | as of rear_load
clear_distance | 0.01 | m | the plan calls clear what is not, or what it has no rows for | as of \
stations
speed_bound | 0.002 | m/s | the plan's highest speed is below its speed, or breaks a rule | \
rounding
limiting | 0.5 | 1 | the rule that the plan names is slack | 1 stands for a false name
status | 0.5 | 1 | status or reason is false, or infeasible | 1 stands for a false word
spacing | 0.01 | share | rows are too far apart to judge what is between them | rounding in files
columns | 1 | of what is allowed | columns of the plan contradict its positions, speeds or map | \
allowed are 1 cm and 0.2 % of stations, 2 cm of heights, 0.6° of slopes, 0.02 1/m and 10 % of \
curvature, 0.03 m/s² and 3 % of acceleration, 20 ms and 0.5 % of time
"""


def _row(line: str) -> tuple[str, Tolerance]:
    kind, value, unit, meaning, rationale = line.split(" | ")
    return kind, Tolerance(float(value), unit, meaning, rationale)


TOLERANCES: dict[str, Tolerance] = dict(map(_row, _TABLE.splitlines()))
"""Every kind of violation. Shares are of the limit that is passed."""
