"""The plan page: complete, self-contained, safe against any name, and true to the plans."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import io
import json
import re
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from slopewise.models.arrays import Floats
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
from slopewise.services.report import relief
from slopewise.services.report.page import asset, script_json
from slopewise.services.report.plan_labels import LIMITING_MEANING, STATUS_MEANING, limit_colours
from slopewise.services.report.plan_page import thinned, write_plan_page
from slopewise.services.report.plan_summary import best_plan, summarise, verdict

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


class _PageReader(HTMLParser):
    """Elements with their attributes, and the text inside each kind of element."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._open.append(tag)
        self.texts.setdefault(tag, []).append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self._open:
            self.texts[self._open[-1]][-1] += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


@pytest.fixture(scope="module")
def page(text: str) -> _PageReader:
    return _PageReader(text)


def embedded(text: str) -> Any:
    """Data of the script of a page; rejects constants that JSON does not know."""
    match = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)
    assert match is not None

    def reject(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(match[1], parse_constant=reject)


def plan_of(
    name: str = "generated", status: Status = Status.OK, stations: int = 40, **changes: Any
) -> SpeedPlan:
    station = 0.25 * np.arange(stations)
    speed = np.sqrt(np.clip(np.minimum(2.0 * station, 2.0 * (station[-1] - station)), 0.0, 4.0))
    plan = SpeedPlan(
        candidate=name,
        status=status,
        reason="",
        station=station,
        x=station,
        y=0.1 * station,
        z=0.0 * station,
        grade=0.0 * station,
        roll=0.0 * station,
        curvature=0.0 * station,
        speed=speed,
        accel=np.gradient(speed),
        time=0.2 * np.arange(stations),
        speed_bound=speed,
        limiting=np.arange(stations) % len(Limiting),
        stop_distance=0.5 * speed,
        clear_distance=float(station[-1]) + 1.0,
        rear_load=np.full(stations, 0.7),
        side_load=np.full(stations, 0.9),
    )
    return dataclasses.replace(plan, **changes)


def pixels_of(uri: str) -> Any:
    """Pixels (rows, cols, 2) of a grey picture with transparency, 8 bits each."""
    png = base64.b64decode(uri.removeprefix("data:image/png;base64,"))
    picture = Image.open(io.BytesIO(png))
    assert picture.mode == "LA"
    return np.asarray(picture)


class TestPage:
    def test_has_its_parts(self, page: _PageReader) -> None:
        ids = {attributes.get("id") for _, attributes in page.elements}
        assert {"map", "canvas", "relief", "charts", "table", "select", "cursor", "data"} <= ids
        assert page.all("html") == [{"lang": "en"}]
        assert len(page.all("h1")) == 1
        assert any(meta.get("name") == "viewport" for meta in page.all("meta"))

    def test_one_row_and_option_per_plan_in_their_order(
        self, page: _PageReader, plans: list[SpeedPlan]
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

    def test_loads_nothing(self, text: str, page: _PageReader) -> None:
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

    def test_runs_its_own_script_only(self, text: str, page: _PageReader) -> None:
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

    def test_names_stay_text(self, text: str, page: _PageReader, plans: list[SpeedPlan]) -> None:
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
        self, text: str, page: _PageReader, plans: list[SpeedPlan]
    ) -> None:
        badges = [a for a in page.all("span") if (a.get("class") or "").startswith("badge")]
        assert [a["class"] for a in badges] == [f"badge {plan.status.value}" for plan in plans]
        for status in Status:
            assert f'id="icon-{status.value}"' in text
            assert f".badge.{status.value}" in text

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
            assert "nan" not in _PageReader(file.read_text()).texts["td"]
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


class TestSummary:
    def test_numbers_of_a_plan(self) -> None:
        plan = plan_of(limiting=np.r_[np.full(30, 7), np.full(10, 0)])
        summary = summarise(plan, 3)
        assert summary.rank == 3
        assert summary.progress == pytest.approx(plan.progress)
        assert summary.mean_speed == pytest.approx(plan.progress / plan.travel_time)
        assert summary.max_speed == pytest.approx(plan.speed.max())
        assert summary.margin == pytest.approx(plan.least_margin)
        assert summary.rear_load == pytest.approx(0.7)
        assert summary.longest_limit is Limiting.ACCEL
        assert summary.limits_share == pytest.approx(30 / 39)

    def test_loads_beyond_the_stop_are_ignored(self) -> None:
        speed = np.where(np.arange(40) < 20, 1.0, 0.0)
        loads = np.where(np.arange(40) > 25, 0.1, 0.6)
        assert summarise(plan_of(speed=speed, rear_load=loads), 1).rear_load == 0.6

    @pytest.mark.parametrize(
        ("statuses", "sentence"),
        [
            ("", "There was no candidate to plan."),
            ("o", "The candidate reaches the end of its path."),
            ("bb", "All 2 candidates stop short of the end of their paths."),
            ("ob", "Of 2 candidates, 1 reaches the end of its path and 1 stops short of it."),
            (
                "oobddi",
                "Of 6 candidates, 2 reach the end of their paths, 1 stops short of it, "
                "2 need a fallback and 1 is infeasible.",
            ),
        ],
    )
    def test_verdict(self, statuses: str, sentence: str) -> None:
        status_of = {status.value[0]: status for status in Status}
        assert verdict([plan_of(status=status_of[letter]) for letter in statuses]) == sentence

    def test_best_plan_is_the_first_that_may_be_driven(self) -> None:
        infeasible, blocked = plan_of(status=Status.INFEASIBLE), plan_of(status=Status.BLOCKED)
        assert best_plan([infeasible, blocked, blocked]) == 1
        assert best_plan([infeasible]) is None


class TestRelief:
    def test_png_round_trip(self) -> None:
        pixels = np.random.default_rng(0).integers(0, 256, (7, 5, 2)).astype(np.uint8)
        np.testing.assert_array_equal(pixels_of(relief.png_uri(pixels)), pixels)

    def test_page_contains_the_map_north_up(self, page: _PageReader, ground: ElevationMap) -> None:
        (picture,) = page.all("img")
        pixels = pixels_of(picture["src"] or "")
        known = np.isfinite(ground.elevation)[::-1]
        np.testing.assert_array_equal(pixels[..., 1] == 255, known)

    def test_light_is_from_the_north_west(self) -> None:
        y, x = np.mgrid[0:40, 0:40] * 0.5
        north_west, level, south_east = (
            relief.shade(heights, 0.5)[20, 20, 0]
            for heights in (0.3 * (x - y), 0.0 * x, 0.3 * (y - x))
        )
        assert south_east + 40 < level < north_west

    def test_coarsening_averages_and_keeps_the_unknown(self) -> None:
        heights = np.arange(24.0).reshape(4, 6)
        heights[:2, :2] = np.nan
        heights[0, 2] = np.nan
        mean, factor = relief.coarsen(heights, 3)
        assert factor == 2
        assert np.isnan(mean[0, 0])
        assert mean[0, 1] == pytest.approx(np.mean([3.0, 8.0, 9.0]))
        assert mean[1, 2] == pytest.approx(np.mean([16.0, 17.0, 22.0, 23.0]))

    def test_large_maps_keep_their_place(self) -> None:
        ground = ElevationMap(elevation=np.zeros((1801, 20)), resolution=0.5, origin=(7.0, 9.0))
        _, table = relief.relief(ground)
        assert table["cell"] == 1.5
        left, right, bottom, top = table["bounds"]
        assert (left, bottom) == (-0.25, -0.25)
        assert right >= 19.5 * 0.5
        assert top >= 1800.5 * 0.5
        assert table["first"] == 0.5


def points_of(path: str) -> list[Floats]:
    """Lines of SVG path data, each (n, 2) in cells."""
    lines = []
    for line in path.split("M")[1:]:
        start, _, steps = line.partition("l")
        first = np.array(start.split(), float)
        moves = np.array(steps.split(), float).reshape(-1, 2)
        lines.append(np.concatenate((first[None], first + np.cumsum(moves, axis=0))) / 10.0)
    return lines


class TestContours:
    def test_cone_has_one_closed_circle(self) -> None:
        y, x = np.mgrid[0:41, 0:41] - 20.0
        (circle,) = points_of(relief.contour_path(-np.hypot(x, y), -12.0))
        np.testing.assert_allclose(np.hypot(*(circle - 20.0).T), 12.0, atol=0.12)
        np.testing.assert_allclose(circle[0], circle[-1], atol=1e-9)

    def test_every_point_lies_at_its_height(self) -> None:
        heights = relief.smoothed(np.random.default_rng(2).normal(size=(30, 40)))
        for line in points_of(relief.contour_path(heights, 0.1)):
            for u, v in line:
                if abs(v - round(v)) <= abs(u - round(u)):  # on a row
                    height = np.interp(u, np.arange(40), heights[round(v)])
                else:
                    height = np.interp(v, np.arange(30), heights[:, round(u)])
                assert height == pytest.approx(0.1, abs=0.12)

    def test_lines_end_at_unknown_ground(self) -> None:
        y, x = np.mgrid[0:20, 0:30].astype(float)
        heights = np.where((x > 12) & (x < 18), np.nan, y)
        lines = points_of(relief.contour_path(heights, 9.5))
        ends = sorted((line[:, 0].min(), line[:, 0].max()) for line in lines)
        assert ends == [(0.0, 12.0), (18.0, 29.0)]

    def test_outlines_close_at_the_edge_of_the_map(self) -> None:
        mask = np.zeros((6, 8), bool)
        mask[:, 5:] = True
        (outline,) = points_of(relief.outline_path(mask))
        np.testing.assert_allclose(outline[0], outline[-1], atol=1e-9)
        assert outline[:, 0].min() == pytest.approx(4.5)

    def test_flat_and_spiky_ground_have_no_contours(self) -> None:
        assert relief.contour_path(np.zeros((5, 5)), 0.5) == ""
        spiky = np.zeros((50, 50))
        spiky[25, 25] = 1e9
        assert len(relief.contour_levels(spiky, relief.contour_interval(spiky))) == 0
