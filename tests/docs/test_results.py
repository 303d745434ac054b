"""Tables of the page on benchmarks come from stored results, and only from such as fit."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS / "site"))

import results  # noqa: E402

STORED = sorted((DOCS / "results").glob("*.json"))
OPTIMALITY = {
    "solved_by_both": 7,
    "excess": {"least": 0.0, "median": 0.001, "p90": 0.002, "p99": 0.003, "most": 0.00412},
    "seconds": {"IPOPT": {"median": 0.002}},
    "ratio": {"median": 12.3, "least": 4.0, "share": 0.5},
    "above": [{"excess": 0.02, "name": "steep | icy"}],
    "unsolved": [],
}
PAGE = "before\n<!-- results: optimality -->\nby hand\n<!-- end of results -->\nafter\n"


def put(folder: Path, name: str, result: object) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(json.dumps(result))
    return folder / name


def test_what_was_written_by_hand_stays_until_there_is_a_result(tmp_path: Path) -> None:
    assert results.filled(PAGE, tmp_path) == PAGE
    put(tmp_path, "optimality.json", OPTIMALITY)
    page = results.filled(PAGE, tmp_path)
    assert "by hand" not in page
    assert page.startswith("before\n<!-- results: optimality -->\n\nMeasured")
    assert page.endswith("\n\n<!-- end of results -->\nafter\n")
    assert results.filled(page, tmp_path) == page
    assert "\n| problems solved by both | 7 |" in page
    assert "\n| travel time above it, most | 0.412% |" in page
    assert "2.00% above the optimum: steep &#124; icy" in page
    assert "(results/optimality.json)" in page


def test_date_and_machine_are_stored_with_a_result(tmp_path: Path) -> None:
    file = put(tmp_path, "o.json", OPTIMALITY | {"quick": True})
    stored = results._keep("optimality", file, tmp_path / "results", "Next to other work.")
    measured = json.loads(stored.read_text())["measured"]
    text = results.shown("optimality", stored)
    assert text.startswith(f"Small run (`--quick`) on {measured['date']} with slopewise")
    assert f"on {measured['cores']} cores" in text
    assert "(results/optimality.json). Next to other work.\n" in text


@pytest.mark.parametrize(
    ("name", "result", "message"),
    [
        ("cycle.json", OPTIMALITY, "a place for cycle"),
        ("optimality.json", {"seconds": 1}, "writes now"),
        ("optimality.json", [], "writes now"),
    ],
)
def test_a_result_that_does_not_fit_is_named(
    tmp_path: Path, name: str, result: object, message: str
) -> None:
    put(tmp_path, name, result)
    with pytest.raises(results.ResultError, match=message) as error:
        results.filled(PAGE, tmp_path)
    assert name in str(error.value)


def test_misses_are_bold() -> None:
    assert results._cell("[red]miss") == "**miss**"
    assert results._cell("[green]pass[/]") == "pass"


@pytest.mark.parametrize("file", STORED, ids=lambda file: file.stem)
def test_stored_results_are_on_the_page_as_it_is_written(file: Path) -> None:
    page = (DOCS / "benchmarks.md").read_text()
    assert f"(results/{file.name})" in page
    assert "No result of a full run is stored" not in page
    shown = results.shown(file.stem, file)
    assert shown.count("\n| ") > 3
    assert shown in page, "`make docs` writes the tables"


def test_the_page_is_what_the_script_writes() -> None:
    page = (DOCS / "benchmarks.md").read_text()
    assert results.filled(page, DOCS / "results") == page, "`make docs` writes the tables"
