"""The brake sheet as a page: models of all kinds are drawn, and its text states the numbers."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.models.parameters import Effect, Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.report.brake_numbers import BrakeNumbers
from slopewise.services.report.brake_sheet import (
    brake_rows,
    rule_notes,
    sheet_json,
    slope_rows,
    unsafe_rule_warning,
    write_sheet,
)


def of(**of_braking: object) -> BrakeNumbers:
    model = read_model(find_model("atv"))
    braking = dataclasses.replace(model.braking, **of_braking)
    return BrakeNumbers(dataclasses.replace(model, braking=braking), Uncertainty())


def with_effects(model: Model) -> Model:
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    wind = Effect(name="headwind", parameters={"c": 0.01, "wind": 5.0, "direction": 1.0})
    return dataclasses.replace(model, effect=(lag, wind))


KINDS = {
    "as shipped": of(),
    "brakes that do not hold the steepest descent": of(b_b=0.25, m_b=0.0, b_m=0.1, m_m=0.0),
    "trained on level ground only": of(grade_range=(-0.005, 0.005)),
    "trained uphill only": of(grade_range=(0.02, 0.2)),
    "nearly one speed": of(speed_range=(2.0, 2.02)),
    "surfaces and a weaker state": of(
        terrain={
            "<sand>": SurfaceBraking(b_b=0.3),
            "ice": SurfaceBraking(b_b=0.16, m_b=0.0),
            "worn": SurfaceBraking(b_b=0.35, state_of=""),
        }
    ),
    "effects": BrakeNumbers(with_effects(read_model(find_model("atv"))), Uncertainty()),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_model_has_a_sheet(kind: str, tmp_path: Path) -> None:
    # Most of the time of a PDF is its fonts, which are those of any other.
    path = tmp_path / ("sheet.pdf" if kind == "effects" else "sheet.html")
    write_sheet(path, KINDS[kind], {"stops": "<b>24</b>"}, "log 0123  a.csv")
    page = path.read_bytes()
    assert page.startswith(b"%PDF") or b"image/" in page


@pytest.mark.parametrize("ending", ["pdf", "html"])
def test_the_same_model_has_the_same_sheet(ending: str, tmp_path: Path) -> None:
    first, second = (tmp_path / f"{name}.{ending}" for name in ("first", "second"))
    for path in (first, second):
        write_sheet(path, KINDS["nearly one speed"], {}, "log 0123  <b>a.csv</b>")
    assert first.read_bytes() == second.read_bytes()
    assert b"<b>a.csv" not in first.read_bytes()


def test_stop_that_does_not_end_is_null() -> None:
    weak = KINDS["brakes that do not hold the steepest descent"]
    assert np.isinf(weak.sheet_table.allowed[-1, 0])
    assert "does not end" in unsafe_rule_warning(weak)
    sheet = sheet_json(weak)
    assert sheet["allowed_distance"][-1][0] is None
    assert sheet["slopes"]["stops_downhill"]["claimed"] < 0.26
    assert "+" not in slope_rows(weak)["stops uphill, downhill"].split(", ")[1]


def test_without_trained_descent_no_rule_is_called_unsafe() -> None:
    numbers = KINDS["trained uphill only"]
    assert "unsafe" not in unsafe_rule_warning(numbers)
    assert "on no trained grade" in rule_notes(numbers)


def test_other_surfaces_are_listed_longest_stop_first() -> None:
    numbers = KINDS["surfaces and a weaker state"]
    rows = brake_rows(numbers)
    ice, sand = rows["longest stop on others"].split(", ")
    assert ice == "ice –"
    assert sand.startswith("<sand> ")
    assert float(sand.split()[1]) > 4.0
    assert "longest stop on others" not in brake_rows(of())


def test_another_ending_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.html or \.pdf"):
        write_sheet(tmp_path / "sheet.png", of(), {}, "")
