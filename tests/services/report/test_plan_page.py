"""The plan page: complete, self-contained, safe against any name, and true to the plans."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.models.parameters import Model
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.ranking import rank
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.report.page import asset, script_json
from slopewise.services.report.plan_labels import LIMITING_MEANING, STATUS_MEANING, limit_colours
from slopewise.services.report.plan_page import thinned, write_plan_page
from tests.services.report.page_fixtures import PageReader, embedded, pixels_of, plan_of

EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(1)> \"'&{{ 7 * 7 }}"
VENDORED = ("uPlot.iife.min.js", "uPlot.min.css", "uPlot-LICENSE.txt")


@pytest.fixture(scope="module")
def model() -> Model:
    return read_model(find_model("atv"))


@pytest.fixture(scope="module")
def ground() -> ElevationMap:
    """400 x 400 cells: hills, a side slope, a ditch and unseen ground, far from the origin."""
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(400) * 0.2, np.arange(400) * 0.2)
    z = 1.1 * np.sin(x / 11) + 0.9 * np.cos(y / 9) + 0.05 * y + 0.01 * rng.normal(size=x.shape)
    z -= 0.5 * np.exp(-(((x - 45.0) / 0.8) ** 2)) * (y < 35.0)
    z[np.hypot(x - 60.0, y - 45.0) < 6.0] = np.nan
    sand = (np.abs(x - 25.0) < 4.0).astype(np.int64)
    return ElevationMap(
        elevation=z,
        resolution=0.2,
        origin=(443000.0, 5410000.0),
        terrain_class=sand,
        class_names=("", "<sand>"),
    )


@pytest.fixture(scope="module")
def plans(model: Model, ground: ElevationMap) -> list[SpeedPlan]:
    start = np.array([443010.0, 5410040.0])
    paths = []
    for j, heading in enumerate(np.linspace(-0.4, 0.4, 50)):
        end = start + 60.0 * np.array([np.cos(heading), np.sin(heading)])
        paths.append(CandidatePath(EVIL if j == 30 else f"fan {j:02d}", np.stack((start, end))))
    answer = CandidatePlanner(model).plan(ground, paths, start_speed=1.0, clear=50.0)
    return rank(answer, PlannerSettings())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(scope="module")
def text(ground: ElevationMap, plans: list[SpeedPlan], model: Model, folder: Path) -> str:
    facts = {"map": "hill.tif", "<b>odd</b>": "${body} & $data", "date": "2026-03-14"}
    file = folder / "plans.html"
    write_plan_page(file, ground, plans, model, title=f"Hill {EVIL}", provenance=facts)
    return file.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(text: str) -> PageReader:
    return PageReader(text)


class TestPage:
    def test_has_its_parts(self, page: PageReader) -> None:
        ids = {attributes.get("id") for _, attributes in page.elements}
        assert {"map", "canvas", "relief", "charts", "table", "select", "cursor", "data"} <= ids
        assert page.all("html") == [{"lang": "en"}]
        assert len(page.all("h1")) == 1
        assert any(meta.get("name") == "viewport" for meta in page.all("meta"))

    def test_one_row_and_option_per_plan_in_their_order(
        self, page: PageReader, plans: list[SpeedPlan]
    ) -> None:
        order = [str(i) for i in range(len(plans))]
        assert [row["data-plan"] for row in page.all("tr") if "data-plan" in row] == order
        picks = [
            name
            for name, attributes in zip(page.texts["button"], page.all("button"), strict=True)
            if attributes.get("class") == "pick"
        ]
        assert picks == [plan.candidate for plan in plans]
        assert [option["value"] for option in page.all("option")] == order

    def test_loads_nothing(self, text: str, page: PageReader) -> None:
        assert not re.search(r"(?:src|href)\s*=\s*[\"']?\s*(?:https?:)?//", text)
        for _, attributes in page.elements:
            for name in ("src", "href", "srcset", "action", "xlink:href", "poster", "data"):
                value = attributes.get(name) or ""
                assert value.startswith(("data:image/png", "#")) or not value
        assert not page.all("link")
        loading = r"https?:|@import|url\((?!#|\$\{)|XMLHttp|import\("
        for file in (resources.files("slopewise.services.report") / "assets").iterdir():
            content = asset(file.name).replace("http://www.w3.org/2000/svg", "")
            if file.name not in VENDORED:
                assert not re.search(loading, content), file.name
                assert file.name.startswith("live") or "fetch(" not in content, file.name
        vendored = asset(VENDORED[0])
        assert not re.search(r"fetch\(|XMLHttp|import\(|eval\(|Function\(", vendored)
        assert re.findall(r"https?://\S+", vendored) == ["https://github.com/leeoniya/uPlot"]

    def test_licence_of_the_chart_library_is_included(self) -> None:
        assert "MIT License" in asset(VENDORED[2])

    def test_runs_its_own_script_only(self, text: str, page: PageReader) -> None:
        policy = next(
            meta["content"]
            for meta in page.all("meta")
            if meta.get("http-equiv") == "Content-Security-Policy"
        )
        assert policy is not None
        assert policy.startswith("default-src 'none'")
        assert "unsafe-inline" not in policy.split("script-src")[1]
        assert "connect-src" not in policy
        scripts = [s for s in page.all("script") if s.get("type") != "application/json"]
        assert scripts == [{}]
        body = text.rpartition("<script>")[2].partition("</script>")[0]
        digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
        assert f"script-src 'sha256-{digest}'" in policy

    def test_names_stay_text(self, text: str, page: PageReader, plans: list[SpeedPlan]) -> None:
        assert "alert(1)</script>" not in text
        assert not any("onerror" in attributes for _, attributes in page.elements)
        assert page.texts["title"][0].startswith(f"Hill {EVIL}")
        assert page.texts["h1"] == [f"Hill {EVIL}"]
        assert "<b>odd</b>" in page.texts["dt"]
        assert "${body} & $data" in page.texts["dd"]
        data = embedded(text)
        assert [plan["name"] for plan in data["plans"]] == [plan.candidate for plan in plans]
        assert data["map"]["surfaces"][0]["name"] == "<sand>"

    def test_statuses_have_names_and_signs_besides_colours(
        self, text: str, page: PageReader, plans: list[SpeedPlan]
    ) -> None:
        badges = [a for a in page.all("span") if (a.get("class") or "").startswith("badge")]
        assert [a["class"] for a in badges] == [f"badge {plan.status.value}" for plan in plans]
        for status in Status:
            assert f'id="icon-{status.value}"' in text
            assert f".badge.{status.value}" in text

    def test_page_contains_the_map_north_up(self, page: PageReader, ground: ElevationMap) -> None:
        (picture,) = page.all("img")
        pixels = pixels_of(picture["src"] or "")
        known = np.isfinite(ground.elevation)[::-1]
        np.testing.assert_array_equal(pixels[..., 1] == 255, known)

    def test_written_as_utf_8(self, tmp_path: Path, ground: ElevationMap, model: Model) -> None:
        file = tmp_path / "out.html"
        plans = [plan_of("lone \ud800 surrogate, nul \x00, Ümläut")]
        write_plan_page(file, ground, plans, model, title="t \udcff", provenance={})
        assert "Ümläut" in file.read_bytes().decode("utf-8")
        assert [p.name for p in tmp_path.iterdir()] == ["out.html"]
        with pytest.raises(InputError, match=r"out\.html"):
            write_plan_page(
                tmp_path / "none" / "out.html", ground, plans, model, title="t", provenance={}
            )

    def test_no_plans(self, folder: Path, ground: ElevationMap, model: Model) -> None:
        file = folder / "none.html"
        write_plan_page(file, ground, [], model, title="t", provenance={})
        text = file.read_text()
        assert "There was no candidate" in text
        assert "<main hidden>" in text
        assert embedded(text)["plans"] == []


class TestData:
    def test_columns_are_those_of_the_plans(
        self, text: str, plans: list[SpeedPlan], ground: ElevationMap
    ) -> None:
        for shown, plan in zip(embedded(text)["plans"], plans, strict=True):
            columns = shown["columns"]
            assert {len(values) for values in columns.values()} == {len(plan.station)}
            np.testing.assert_allclose(columns["speed"], plan.speed, atol=6e-4)
            np.testing.assert_allclose(columns["stop_distance"], plan.stop_distance, atol=6e-4)
            np.testing.assert_allclose(np.array(columns["x"]) + ground.origin[0], plan.x, atol=6e-4)
            np.testing.assert_array_equal(columns["limiting"], plan.limiting)
            assert shown["status"] == plan.status.value

    @pytest.mark.parametrize("moves", [True, False])
    def test_values_that_are_not_finite_become_null(
        self, moves: bool, folder: Path, ground: ElevationMap, model: Model
    ) -> None:
        holes = np.full(40, np.nan)
        holes[::2] = np.inf
        plan = plan_of(
            rear_load=holes,
            side_load=holes,
            stop_distance=holes,
            speed_bound=holes,
            z=holes,
            clear_distance=np.inf,
        )
        if not moves:
            plan = plan_of(status=Status.BLOCKED, speed=np.zeros(40), time=np.zeros(40))
        file = folder / "holes.html"
        write_plan_page(file, ground, [plan], model, title="t", provenance={})
        shown = embedded(file.read_text())["plans"][0]
        assert shown["margin"] is None
        if moves:
            assert shown["clear"] is None
            assert set(shown["columns"]["rear_load"]) == {None}
            assert "nan" not in PageReader(file.read_text()).texts["td"]
        else:
            assert (shown["progress"], shown["mean"]) == (0.0, None)
            assert "None of them may be driven" in file.read_text()

    def test_long_plans_are_thinned_but_keep_extremes(self) -> None:
        speed = np.full(50_000, 2.0)
        speed[31_234] = 0.5
        speed[40_000:] = 0.0
        plan = plan_of(
            stations=50_000,
            speed=speed,
            rear_load=np.where(np.arange(50_000) == 777, 0.2, 0.7),
            side_load=np.full(50_000, 0.9),
        )
        indices = thinned(plan, 400)
        assert {0, 777, 31_234, 40_000, 49_999} <= set(indices.tolist())
        assert len(indices) < 600
        assert (np.diff(indices) > 0).all()

    def test_pages_stay_small(
        self, text: str, folder: Path, ground: ElevationMap, model: Model
    ) -> None:
        assert len(text.encode()) < 6e6
        file = folder / "long.html"
        plans = [plan_of(str(j), stations=4000) for j in range(50)]
        write_plan_page(file, ground, plans, model, title="t", provenance={})
        assert file.stat().st_size < 6e6

    def test_json_cannot_end_its_element(self) -> None:
        value = {"a": "</script><!--\u2028&", "b": [1.5, None]}
        written = script_json(value)
        assert not set("<>&\u2028") & set(written)
        assert json.loads(written) == value
        with pytest.raises(ValueError, match="not JSON compliant"):
            script_json(float("nan"))

    def test_every_status_and_bound_has_meaning_and_colour(self) -> None:
        style = limit_colours()
        assert set(LIMITING_MEANING) == set(Limiting)
        assert set(STATUS_MEANING) == set(Status)
        for code in Limiting:
            assert f"--{code.label}:" in style
            assert f'[data-limiting="{code.label}"]' in style
