"""An argument of a wrong kind is one error that names it, at every public name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import slopewise
from slopewise.models.typed_arguments import typed_arguments

MODEL = slopewise.read_model("atv")
GROUND = slopewise.ElevationMap(elevation=np.zeros((40, 100)), resolution=0.5, origin=(0.0, 0.0))
PATH = slopewise.CandidatePath("straight", np.array([[5.0, 10.0], [30.0, 10.0]]))
STATE = slopewise.PlanarState(x=5.0, y=10.0, heading=0.0, speed=0.0)
ROWS = {"name": "mine", "x": [5.0, 6.0, 7.0], "y": [10.0] * 3, "speed": [1.0, 1.0, 0.0]}
PLAN = slopewise.GivenPlan(**ROWS)
LOG = slopewise.DriveLog({}, (), (), True)
HORIZON = slopewise.Horizon(MODEL)

# Every public name with arguments that are usable, and of each argument what else it may be.
CALLS: dict[str, tuple[Callable[..., object], dict[str, Any]]] = {
    "CandidatePath": (slopewise.CandidatePath, {"name": "a", "points": PATH.points}),
    "ElevationMap": (
        slopewise.ElevationMap,
        {"elevation": GROUND.elevation, "resolution": 0.5, "origin": (0.0, 0.0)},
    ),
    "GivenPlan": (slopewise.GivenPlan, ROWS),
    "Horizon": (slopewise.Horizon, {"model": MODEL}),
    "Horizon.learn": (HORIZON.learn, {"model": MODEL}),
    "Horizon.step": (HORIZON.step, {"state": STATE, "paths": [PATH], "elevation_map": GROUND}),
    "Model": (
        slopewise.Model,
        {n: getattr(MODEL, n) for n in ("name", "vehicle", "braking", "terrain", "limits")},
    ),
    "PlanClient": (slopewise.PlanClient, {"session": None}),
    "PlanarState": (
        slopewise.PlanarState,
        {"x": 5.0, "y": 10.0, "heading": 0.0, "speed": 0.0, "age": 0.0},
    ),
    "calibrate": (slopewise.calibrate, {"log": LOG, "model": MODEL}),
    "check_plan": (
        slopewise.check_plan,
        {"plan": PLAN, "model": MODEL, "elevation_map": GROUND, "clear": 10.0, "quantile": 0.9},
    ),
    "find_discrepancies": (slopewise.find_discrepancies, {"log": LOG, "model": MODEL}),
    "guard_decision": (
        slopewise.guard_decision,
        {
            "model": MODEL,
            "elevation_map": GROUND,
            "pose": (5.0, 5.0, 0.0),
            "speed": 1.0,
            "command": (1.0, 0.0),
            "clear": 10.0,
            "age": 0.0,
            "before": (),
        },
    ),
    "plan": (
        slopewise.plan,
        {
            "model": MODEL,
            "elevation_map": GROUND,
            "paths": [PATH],
            "start_speed": 0.0,
            "clear": 10.0,
        },
    ),
    "read_drive_log": (slopewise.read_drive_log, {}),
    "read_map": (slopewise.read_map, {"file": "ground.tif"}),
    "read_model": (slopewise.read_model, {"name_or_file": "atv"}),
    "read_paths": (slopewise.read_paths, {"file": "paths.csv"}),
    "write_model": (slopewise.write_model, {"model": MODEL, "file": "mine.toml"}),
}
OPTIONAL = {  # arguments that may be omitted, of which None is one
    "CandidatePath": "speed_limit yaw",
    "ElevationMap": "terrain_class",
    "GivenPlan": "station limiting reason",
    "Horizon": "settings planner uncertainty",
    "Horizon.learn": "uncertainty",
    "Horizon.step": "conditions",
    "Model": "steering tracking",
    "calibrate": "map_file settings",
    "find_discrepancies": "map_file settings",
    "plan": "quantile settings",
    "read_map": "nodata",
}
RESULTS = {"CheckReport", "DriveLog", "GuardDecision", "SlopewiseError", "SpeedPlan"}
"""Names of what others give: nothing is read from a user there."""

CASES = [(call, name, None) for call, (_, arguments) in CALLS.items() for name in arguments]
CASES += [
    (call, name, wrong)
    for call, (_, arguments) in CALLS.items()
    for name in (*arguments, *OPTIONAL.get(call, "").split())
    for wrong in (object(), {}, 1j, [None, {}])
]
CASES += [
    (call, name, wrong)
    for call, (_, arguments) in CALLS.items()
    for name, right in arguments.items()
    for wrong in (True, np.zeros((2, 5)), b"1", "1")
    if not isinstance(right, str if isinstance(wrong, str) else np.ndarray)
]


def test_every_public_name_is_called_or_a_result() -> None:
    assert {call.partition(".")[0] for call in CALLS} | RESULTS == set(slopewise.__all__)


@pytest.mark.parametrize("call", CALLS)
def test_a_wrong_kind_names_the_argument(call: str) -> None:
    function, arguments = CALLS[call]
    for argument, wrong in ((name, wrong) for of, name, wrong in CASES if of == call):
        expected = rf"^{argument}(\[\d\])?: expected .*, got "
        with pytest.raises(slopewise.SlopewiseError, match=expected):
            function(**{**arguments, argument: wrong})


@pytest.mark.parametrize(
    ("name", "wrong", "message"),
    [
        ("model", "atv", "model: expected Model, got 'atv'"),
        ("elevation_map", GROUND.elevation, r"ElevationMap, got an array of shape \(40, 100\)"),
        ("paths", PATH, r"list \(each item: CandidatePath\), got CandidatePath"),
        ("paths", [PATH, PATH.points], r"paths\[1\]: expected CandidatePath, got an array"),
        ("start_speed", "1", "start_speed: expected a number, got '1'"),
        ("settings", {}, "settings: expected PlannerSettings or None, got a dict of 0"),
    ],
)
def test_the_message_says_what_was_expected(name: str, wrong: object, message: str) -> None:
    with pytest.raises(slopewise.SlopewiseError, match=message):
        slopewise.plan(**{**CALLS["plan"][1], name: wrong})


@pytest.mark.parametrize("number", [1, 1.0, np.float32(1.0), np.int64(1), np.array(1.0)])
def test_numbers_of_numpy_are_numbers(number: float) -> None:
    (plan,) = slopewise.plan(MODEL, GROUND, (PATH,), start_speed=number, clear=20 * number)
    assert plan.speed[0] == 1.0
    pose, command = np.array([5.0, 5.0, 0.0]), [number, 0.0]
    assert slopewise.guard_decision(MODEL, GROUND, pose, number, command).action == "pass"
    assert replace(STATE, speed=number).invalid_field() == ""


def test_a_flag_of_numpy_is_one() -> None:
    assert replace(GROUND, height_std_is_assumed=np.isnan(np.nan)).height_std_is_assumed
    with pytest.raises(slopewise.SlopewiseError, match=r"expected bool, got 1$"):
        replace(GROUND, height_std_is_assumed=1)


def test_files_may_be_several_and_are_named_by_index(tmp_path: Path) -> None:
    with pytest.raises(slopewise.SlopewiseError, match=r"files\[1\]: expected a text or a path"):
        slopewise.read_drive_log(tmp_path / "a.csv", None)


def test_what_is_missing_or_unknown_is_python_s_own_error() -> None:
    with pytest.raises(TypeError, match="missing a required argument: 'elevation_map'"):
        slopewise.plan(MODEL)
    with pytest.raises(TypeError, match="unexpected keyword argument 'colour'"):
        typed_arguments(lambda: None)(colour=1)


def test_masked_heights_are_unknown() -> None:
    heights = np.ma.masked_less(np.array([[-9999.0, 1.0], [2.0, 3.0]]), 0.0)
    ground = slopewise.ElevationMap(elevation=heights, resolution=1.0, origin=(0.0, 0.0))
    np.testing.assert_array_equal(ground.elevation, [[np.nan, 1.0], [2.0, 3.0]])
    with pytest.raises(slopewise.SlopewiseError, match="a class in every cell, got masked ones"):
        replace(ground, terrain_class=np.ma.masked_equal([[0, 0], [0, 255]], 255))


def test_a_speed_of_no_vehicle_is_refused() -> None:
    with pytest.raises(slopewise.SlopewiseError, match=r">= 0 and <= 1000 \[m/s\], got 1e\+200"):
        slopewise.plan(MODEL, GROUND, [PATH], start_speed=1e200)


def test_classes_are_whole_numbers() -> None:
    for wrong in ([[0.5, 0.0], [0.0, 0.0]], [[np.nan, 0.0], [0.0, 0.0]]):
        with pytest.raises(slopewise.SlopewiseError, match="terrain_class: expected whole numbers"):
            slopewise.ElevationMap(
                elevation=np.zeros((2, 2)), resolution=1.0, origin=(0, 0), terrain_class=wrong
            )
