"""The one meaning of the names by which maps call the surfaces of a model."""

from __future__ import annotations

import pytest

from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.surface_names import candidate_surfaces, number_names, resolve_class

TABLES = {
    "grass": SurfaceBraking(),
    "ice": SurfaceBraking(class_id=7),
    "mud": SurfaceBraking(),
    "grass, weaker": SurfaceBraking(class_id=100, state_of="grass"),
    "weaker": SurfaceBraking(class_id=101, state_of=""),
}


@pytest.mark.parametrize(
    ("name", "surface"),
    [
        ("", ""),
        ("#0", ""),
        ("mud", "mud"),
        ("#7", "ice"),
        ("#1", "grass"),
        ("#3", "mud"),
        # A table that has a number is not meant by its place in the file.
        ("#2", None),
        ("#6", None),
        ("gravel", None),
        ("#", None),
        ("#-1", None),
        ("# 1", None),
    ],
)
def test_class_name_is_that_of_one_surface_or_unknown(name: str, surface: str | None) -> None:
    assert resolve_class(TABLES, name) == surface


def test_class_number_zero_is_the_base_unless_a_surface_has_it() -> None:
    tables = {**TABLES, "sand": SurfaceBraking(class_id=0)}
    assert resolve_class(tables, "#0") == "sand"
    assert resolve_class(tables, "") == ""


def test_candidates_are_the_states_of_a_known_surface_and_all_of_an_unknown_one() -> None:
    assert candidate_surfaces(TABLES, "grass") == ("grass", "grass, weaker")
    assert candidate_surfaces(TABLES, "#0") == ("", "weaker")
    assert candidate_surfaces(TABLES, "#7") == ("ice",)
    assert candidate_surfaces(TABLES, "gravel") == ("", *TABLES)


def test_number_names_call_zero_the_base() -> None:
    assert number_names(0) == ("",)
    assert number_names(3) == ("", "#1", "#2", "#3")
