"""Every number of the discrepancy workflow that somebody chose: value, unit, basis, what it moves.

What a user may want to set is in
:class:`slopewise.models.discrepancy.settings.DiscrepancySettings`, and what belongs to a single
effect is with that effect. Everything else is here, and modules read it from here. A constant's
annotation holds its row, so that it is a plain number to those who use it. Chi squares are
differences of −2 log likelihood; shares, quantiles and p-values have the unit 1.
"""

from __future__ import annotations

import sys
from enum import Enum
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from slopewise.models.arrays import Floats


class Basis(Enum):
    """What a threshold was chosen on."""

    SETS = "those sets of `slopewise bench discrepancy` that docs/benchmarks.md counts as looked at"
    RECORDINGS = "recorded drives and stops of the physics engine"
    THEORY = "the distribution or the geometry that the number follows from"
    USUAL = "what vehicles, sensors, brakes and ground are usually like"
    COMPUTATION = "accuracy against time of the computation"
    GUARD = "division by nothing, and noise of rounding"


class Row(NamedTuple):
    """What stands beside a value."""

    unit: str
    basis: Basis
    moves: str


class Threshold(NamedTuple):
    """One row of the table."""

    name: str
    value: Any
    unit: str
    basis: Basis
    moves: str


_SETS, _THEORY, _USUAL = Basis.SETS, Basis.THEORY, Basis.USUAL
_COMPUTATION, _GUARD, _RECORDINGS = Basis.COMPUTATION, Basis.GUARD, Basis.RECORDINGS

# Stops that are compared, and the table that they make (data).

FEWEST_STOPS: Annotated[int, Row("1", _SETS, "below it a log is refused")] = 12
SURE_MOUNT: Annotated[
    float, Row("rad", _SETS, "std up to which headings alone may tell the mount of a pitch sensor")
] = np.deg2rad(0.15)
LARGEST_MOUNT: Annotated[
    float, Row("rad", _USUAL, "offset up to which headings alone may tell the mount")
] = np.deg2rad(4.0)
PLAIN_MOUNT: Annotated[
    float, Row("std", _SETS, "larger: more offsets of pitch sensors are left in the grades")
] = 3.0
STOP_NODES: Annotated[int, Row("1", _COMPUTATION, "grid times of a stop: accuracy, time")] = 121
MOST_BINS: Annotated[
    int, Row("1", _COMPUTATION, "means of speed per stop: detail within stops, time")
] = 40
HELD_BEFORE: Annotated[
    float, Row("s", _SETS, "held speed that belongs to a stop: how well its level is known")
] = 0.3
LAST_SHARE: Annotated[
    float, Row("1", _RECORDINGS, "larger: rocking near standstill counts as braking")
] = 0.95
MOST_ONSET_BLUR: Annotated[
    float, Row("s", _SETS, "larger: more of the speeds around the onset count for nothing")
] = 0.03
ONSET_BLURS: Annotated[
    float, Row("std", _SETS, "reach of the speeds around the onset that count for nothing")
] = 2.5
NO_WEIGHT: Annotated[
    float, Row("1", _COMPUTATION, "factor of a variance that leaves no weight")
] = 1e4
ABOVE_NOISE: Annotated[
    float, Row("std", _SETS, "larger: stops end earlier where their speed is noisy")
] = 2.5
SMOOTHING: Annotated[
    float, Row("s", _SETS, "larger: measured speeds and grades in products blur, smaller: noise")
] = 0.08
LEAST_PULL: Annotated[
    float, Row("1", _GUARD, "share of the weight that a stop is taken to slow with at least")
] = 0.05

# What a hypothesis predicts, and the noise around it (model).

OUTPUT_SWEEPS: Annotated[
    int, Row("1", _COMPUTATION, "repetitions after which a simulated speed is taken as it is")
] = 12
SAME_SPEED: Annotated[
    float, Row("m/s", _COMPUTATION, "change of a simulated speed that is none: accuracy, time")
] = 1e-5
LEAST_TURNING_SPEED: Annotated[
    float, Row("m/s", _GUARD, "speed below which a yaw rate makes no larger curvature")
] = 0.3
LATEST_SESSION_CLOCK: Annotated[
    float, Row("s", _USUAL, "clock from which a log counts since some epoch, not its session")
] = 1e6
HEATINGS: Annotated[
    int, Row("1", _COMPUTATION, "how often the heat of brakes that fade is worked out anew")
] = 2
LEAST_MEAN_FORCE: Annotated[
    float, Row("1", _GUARD, "mean force by which forces within a stop are divided at least")
] = 1e-3
LEAST_COOLING: Annotated[
    float, Row("s", _GUARD, "shortest time constant of cooling that is computed")
] = 0.5
OSCILLATION_KNOTS: Annotated[
    tuple[float, ...],
    Row("s", _RECORDINGS, "times since the onset between which the body's curve is a line"),
] = (0.0, 0.06, 0.13, 0.21, 0.32)
USUAL_OSCILLATION: Annotated[
    float, Row("m/s", _RECORDINGS, "prior std of that curve: larger hides more of a lag or drag")
] = 0.006
QUICK_BUILD_UP: Annotated[float, Row("s", _USUAL, "lag from which the curve lasts longer")] = 0.08
OTHER_SHAPE: Annotated[
    float, Row("m/s²", _THEORY, "prior std by lag: two equal lags against one differ by as much")
] = 0.4
USUAL_PULL: Annotated[
    float, Row("1", _USUAL, "share of the weight at which the body rocks by that much")
] = 0.45
LEVEL_STD: Annotated[
    float, Row("m/s", _THEORY, "std of the speed at which a stop begins: as good as unknown")
] = 1.0
RIDGE: Annotated[float, Row("1", _GUARD, "added to normal equations")] = 1e-12
LEAST_NOISE: Annotated[float, Row("m/s", _GUARD, "speed noise that a log has at least")] = 1e-3
MOST_CORRELATED: Annotated[
    float, Row("1", _GUARD, "correlation of neighbouring bins that a log has at most")
] = 0.9
NOISE_FLOOR: Annotated[
    tuple[float, ...],
    Row("as Noise", _GUARD, "speed, creep, dead-time and force std that a log has at least"),
] = (1e-3, 2e-2, 1e-3, 1e-4)
ONSET_STEP: Annotated[float, Row("s", _COMPUTATION, "step of derivatives by the onset")] = 1e-3
FORCE_STEP: Annotated[float, Row("1", _COMPUTATION, "step of derivatives by the force")] = 1e-3

# Fitting (search.refine).

FIT_PASSES: Annotated[int, Row("1", _COMPUTATION, "steps of a fit at most")] = 12
FIT_TRIES: Annotated[int, Row("1", _COMPUTATION, "shorter steps that are tried at most")] = 8
FIT_DONE: Annotated[
    float, Row("chi square", _COMPUTATION, "gain of a step below which a fit has ended")
] = 0.01
FIT_BENT: Annotated[
    float, Row("chi square", _COMPUTATION, "gain of a step above which slopes are made anew")
] = 2.0
DERIVATIVE_STEP: Annotated[
    float, Row("scale", _COMPUTATION, "step of derivatives, of a parameter's scale")
] = 1e-3
NOISE_PASSES: Annotated[int, Row("1", _COMPUTATION, "fits and noises in turn")] = 2
FIRST_BUILD_UP: Annotated[
    float, Row("s", _USUAL, "time constant from which a build-up is fitted")
] = 0.04
BUILD_UP_SEEN: Annotated[
    float, Row("chi square", _THEORY, "gain from which a build-up of the brakes is fitted along")
] = 2.0
OSCILLATES: Annotated[
    float, Row("chi square", _SETS, "smaller: weak drags are taken for an oscillating body")
] = 40.0
MOST_WIDER: Annotated[
    float, Row("1", _SETS, "factor by which scattering stops widen an interval at most")
] = 2.0
LEAST_FRICTION: Annotated[float, Row("1", _COMPUTATION, "no place is more slippery than that")] = (
    0.02
)
LEAST_FORCE: Annotated[
    float, Row("1", _GUARD, "median force by which frictions of stops are divided at least")
] = 0.01

# What a log could have shown (search.screening, search.resolvable).

LEAST_COLUMN: Annotated[
    float, Row("1", _GUARD, "share of a candidate beyond the base below which it says nothing")
] = 1e-4
OWN_SCATTERS: Annotated[
    Floats, Row("1", _COMPUTATION, "scatters tried with each candidate, of that fitted")
] = np.geomspace(0.1, 1.3, 9)

# Patches and how well their edges are known (search.patches, search.extent).

CIRCLES: Annotated[int, Row("1", _COMPUTATION, "circles tried anywhere: missed patches, time")] = (
    1500
)
CIRCLES_KEPT: Annotated[int, Row("1", _COMPUTATION, "circles that are gone on with")] = 3
CIRCLE_TRIES: Annotated[int, Row("1", _COMPUTATION, "tries around each in a round")] = 80
CIRCLE_MOVES: Annotated[
    tuple[float, ...], Row("radii", _COMPUTATION, "how far circles are moved, by round")
] = (0.3, 0.2, 0.15, 0.1, 0.07, 0.05)
SMALLEST_PATCH: Annotated[
    float, Row("fields", _SETS, "radius, of the side of the ground that was driven on")
] = 0.05
LARGEST_PATCH: Annotated[float, Row("fields", _SETS, "the same, of the largest patch")] = 0.5
FEWEST_TOUCHED: Annotated[int, Row("1", _SETS, "stops that a circle has to hold to be tried")] = 3
PLACE_NODES: Annotated[int, Row("1", _COMPUTATION, "grid times that count as one place")] = 6
EDGE_ROUNDS: Annotated[
    tuple[tuple[float, tuple[float, ...]], ...],
    Row("1, radii", _COMPUTATION, "noise within stops, and moves of a patch, coarse to fine"),
] = (
    (10.0, (0.3, 0.2, 0.1)),
    (3.0, (0.2, 0.1, 0.05)),
    (1.0, (0.1, 0.07, 0.05, 0.03, 0.02, 0.01)),
)
CHI2_95: Annotated[float, Row("chi square", _THEORY, "95 % of one number")] = 3.84
NORMAL_95: Annotated[float, Row("std", _THEORY, "95 % of a normal distribution")] = 1.96
JUMP_95: Annotated[
    float, Row("chi square", _THEORY, "95 % of a likelihood that has jumps (Hansen 2000)")
] = 7.35
UNFITTED_SHARE: Annotated[
    float, Row("1", _SETS, "share of chi square that numbers not fitted again may be worth")
] = 0.01
EXTENT_ROUNDS: Annotated[int, Row("1", _COMPUTATION, "searches for the extent of a patch")] = 24
EXTENT_MOVES: Annotated[
    tuple[float, ...], Row("radii", _COMPUTATION, "how far they reach, in turn")
] = (0.1, 0.3, 0.05, 0.2)
EDGE_SIDES: Annotated[
    float, Row("1", _SETS, "wider edges, because more than four sides of a circle are uncertain")
] = 1.25

# Axes that a disagreement may follow (search.axes, search.locate).

COARSE_BUMPS: Annotated[int, Row("1", _SETS, "coarse shapes along an axis")] = 4
FINE_BUMPS: Annotated[int, Row("1", _SETS, "fine shapes: more find narrower patterns, later")] = 9
WAVES: Annotated[int, Row("1", _SETS, "periods of a wave within an axis at most")] = 12
HARMONICS: Annotated[int, Row("1", _SETS, "waves around a heading")] = 3
PLACE_BUMPS: Annotated[int, Row("1", _SETS, "bumps along each side of a map")] = 4
AXIS_COOLING: Annotated[
    float, Row("s", _USUAL, "time constant of a brake of which nothing is known, for its axis")
] = 60.0
LEAST_AXIS_SPREAD: Annotated[
    float, Row("of the axis", _GUARD, "range of an axis below which all stops are the same")
] = 1e-6
PERMUTATIONS: Annotated[
    int, Row("1", _COMPUTATION, "logs in another order: accuracy of p-values, time")
] = 200
LEAST_DIRECTION: Annotated[
    float, Row("1", _GUARD, "share of the largest direction of shapes below which one is none")
] = 1e-4

# What other numbers of the model's own would hide (search.absorbed).

USUAL_GRADE_BIAS: Annotated[
    float, Row("rad", _USUAL, "error of all grades that is not seen at once")
] = np.deg2rad(2.5)
ABSORBED_SHARE: Annotated[
    float, Row("1", _SETS, "smaller: more logs are `unidentifiable` instead of `parameter_drift`")
] = 0.98
P_ABSORBED: Annotated[
    float, Row("1", _THEORY, "p-value from which one cause is as good as new coefficients")
] = 0.05

# From weights to one word (decide.verdict, workflow).

PATCH_TRIES: Annotated[
    int, Row("1", _COMPUTATION, "patches tried near another one: accuracy of its place, time")
] = 48
WILD_SCATTER: Annotated[
    float, Row("1", _RECORDINGS, "scatter of the force from which a doubt is said")
] = 0.12
LEAST_LAG: Annotated[
    float, Row("s", _USUAL, "lag from which it has a shape of its own; shorter ones end in 0.1 s")
] = 0.036
CHANGED_STOPS: Annotated[
    int, Row("1", _USUAL, "stops that an effect has to change by a practical size to matter")
] = 3

# How far the gap closes, and the model that is written (decide.gap, decide.revised).

CLAIM_ABOVE: Annotated[
    float, Row("1", _SETS, "floors that a gap needs for a percentage of it to mean something")
] = 1.5
SIMULATED_SPAN: Annotated[
    float, Row("1", _USUAL, "times a measured stop within which a simulated one has to end")
] = 2.0
BY_CHANCE: Annotated[
    float, Row("std", _THEORY, "distance by which one stop in ten thousand ends late by chance")
] = 4.0
SIMULATED_NODES: Annotated[int, Row("1", _COMPUTATION, "grid times of a simulated stop")] = 241
OFFSET_COVERAGE: Annotated[
    float, Row("1", _USUAL, "share of stops that the safety offset covers, as in calibration")
] = 0.995
RIVAL_COVERAGE: Annotated[
    float, Row("1", _SETS, "share of stops in which the offset covers a rival, too")
] = 0.97
RANGE_PAD: Annotated[
    float, Row("1", _SETS, "of a range: how far beyond it a log vouches for new coefficients")
] = 0.1

# What is told and proposed (report).

LOCATED: Annotated[float, Row("1", _THEORY, "p-value up to which an axis is listed")] = 0.05
PICTURED_SPEED: Annotated[float, Row("m/s", _USUAL, "of the stop that a cost is told for")] = 3.0
PICTURED_GRADE: Annotated[float, Row("rad", _USUAL, "the same, 10° down")] = np.deg2rad(-10.0)
PICTURED_HEADINGS: Annotated[int, Row("1", _COMPUTATION, "headings of which the worst counts")] = 12
MOST_SURE: Annotated[
    float, Row("1", _THEORY, "more than that is not said: nobody knows better what else there is")
] = 0.99
MOST_REPEATS: Annotated[int, Row("1", _USUAL, "times that anybody drives a proposed design")] = 5
PROPOSED_STOPS: Annotated[int, Row("1", _SETS, "stops of a proposed design")] = 6
PROPOSED_PAUSES: Annotated[
    tuple[float, ...], Row("s", _USUAL, "pauses before a stop that are proposed, warm to cold")
] = (5.0, 60.0, 900.0)
WARMING_STOPS: Annotated[
    int, Row("1", _SETS, "stops that are driven before one after the shortest pause")
] = 6
TELLS_APART: Annotated[
    float, Row("chi square", _SETS, "larger: proposed designs are repeated more often")
] = 12.0
WORTH_DRIVING: Annotated[
    float, Row("1", _USUAL, "of its std, to which a number has to shrink for stops to be proposed")
] = 0.9
SHEET_NODES: Annotated[int, Row("1", _COMPUTATION, "grid times of a proposed stop")] = 61
SHEET_BINS: Annotated[int, Row("1", _COMPUTATION, "bins of a proposed stop")] = 20


def table() -> tuple[Threshold, ...]:
    """All thresholds, in the order of this file."""
    hints = get_type_hints(sys.modules[__name__], include_extras=True)
    return tuple(
        Threshold(name, globals()[name], *row)
        for name, hint in hints.items()
        for row in getattr(hint, "__metadata__", ())
        if isinstance(row, Row)
    )
