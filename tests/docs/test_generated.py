"""Generated pages that are stored for a code host equal the output of their scripts."""

from __future__ import annotations

import itertools
import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs" / "site"))

import reference  # noqa: E402
import samples  # noqa: E402
import sizes  # noqa: E402

from slopewise.planner.limiting import BOUNDS, Limiting  # noqa: E402

NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


@pytest.mark.parametrize("name", reference.PAGES)
def test_a_reference_page_is_what_the_code_says(name: str) -> None:
    stored = reference.FOLDER / name
    assert stored.read_text() == reference.page(name), "`make docs` writes the pages"
    assert {file.name for file in reference.FOLDER.iterdir()} == set(reference.PAGES)


def test_every_bound_is_documented() -> None:
    assert len(BOUNDS) == len(Limiting) == 20, "docs/concepts.md says how many there are"
    page = reference.page("bounds.md")
    assert all(f"| `{bound.label}` |" in page for bound in Limiting)


def test_samples_on_the_readme_are_what_their_commands_print(tmp_path: Path) -> None:
    """Text exactly; numbers to the last digit but one, because processors differ."""
    samples.made_up(tmp_path)
    page = (ROOT / "README.md").read_text()
    assert len(samples.PLACE.findall(page)) >= 1
    rendered = samples.filled(page, lambda command: samples.output_of(command, tmp_path))
    assert NUMBER.sub("#", rendered) == NUMBER.sub("#", page), "`make docs` writes the samples"
    for now, then in zip(NUMBER.findall(rendered), NUMBER.findall(page), strict=True):
        assert float(now) == pytest.approx(float(then), rel=0.005, abs=0.02)


def test_figures_of_the_readme_are_stored_results() -> None:
    page = " ".join((ROOT / "README.md").read_text().split())
    folder = ROOT / "docs" / "results"
    loop = json.loads((folder / "closed-loop.json").read_text())
    ours = loop["policies"]["slopewise"]
    assert f"{ours['forced_stops']:,} forced stops in {ours['drives']} drives" in page
    assert f"{ours['finished']} drives reached their end" in page
    assert ours["collisions"] == ours["past_clear"] == 0
    share = ours["mean_speed"] / loop["policies"]["perfect knowledge"]["mean_speed"]
    assert f"{100.0 * share:.0f} % of the mean speed" in page
    alone, _, busy = json.loads((folder / "cycle.json").read_text())["runs"]
    assert f"{1e3 * alone['p50']:.1f} ms at the median and {1e3 * alone['p99']:.1f} ms" in page
    assert f"busy {1e3 * busy['p50']:.1f} and {1e3 * busy['p99']:.1f} ms" in page
    peers = json.loads((folder / "planner.json").read_text())["targets"]
    missed = sum(not row["passed"] for row in peers)
    assert (missed, len(peers)) == (4, 8), (
        "expected other numbers in the next line, and on the page"
    )
    assert "Four of its eight targets are missed" in page


def test_the_sizes_of_the_quick_start_are_those_of_an_installation() -> None:
    """Where everything is installed; another build of a package may be somewhat larger."""
    for extra in sizes.extras():
        for name in sizes.brought(extra):
            if sizes.size(name) == 0.0:
                pytest.skip(f"{name} is not installed")
    (stored,) = sizes.PLACE.findall(sizes.PAGE.read_text())
    rows = [
        re.findall(r"^\| (.*?) \| (?:\+ )?(\d+) \|", text, re.MULTILINE)
        for text in (stored, sizes.table())
    ]
    assert [name for name, _ in rows[0]] == [name for name, _ in rows[1]]
    for (name, then), (_, now) in zip(*rows, strict=True):
        assert float(now) == pytest.approx(float(then), rel=0.25, abs=3.0), name


IMPORTED_AS = {
    "eclipse-zenoh": "zenoh",
    "pillow": "PIL",
    "foxglove-sdk": "foxglove",
    "dask": "distributed",
    "mkdocs-material": "",
    "commonroad-vehicle-models": "vehiclemodels",
}
"""Where the name of the module is another one; mkdocs-material is named in mkdocs.yml."""


def test_every_dependency_of_users_is_imported() -> None:
    code = "".join(
        file.read_text()
        for folder in ("slopewise", "models", "planner", "services", "benchmarks", "docs/site")
        for file in (ROOT / folder).rglob("*.py")
    )
    project = sizes.project()
    extras = (project["optional-dependencies"][extra] for extra in sizes.extras())
    for line in itertools.chain(project["dependencies"], *extras):
        name = re.split(r"[^\w.-]", line)[0]
        module = IMPORTED_AS.get(name, name.replace("-", "_"))
        pattern = rf"^\s*(?:from|import) {module}\b|module\(\"{module}"
        assert not module or re.search(pattern, code, re.MULTILINE), name
