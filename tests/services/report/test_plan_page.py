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
from slopewise.planner.limiting import BOUNDS, Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.ranking import rank
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.jobs.plan import PlanResult
from slopewise.services.report.page import asset, script_json
from slopewise.services.report.plan_labels import STATUS_MEANING, limit_colours
from slopewise.services.report.plan_numbers import best_plan, numbers_of, verdict
from slopewise.services.report.plan_page import thinned, write_plan_page
from tests.services.report.page_fixtures import PageReader, embedded, pixels_of, plan_of

EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(1)> \"'&{{ 7 * 7 }}"
VENDORED = ("uPlot.iife.min.js", "uPlot.min.css", "uPlot-LICENSE.txt")
MODEL = read_model(find_model("atv"))


@pytest.fixture(scope="module")
def ground() -> ElevationMap:
    """400 x 400 cells: hills, a side slope, a ditch and unseen ground, far from the origin."""
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(400) * 0.2, np.arange(400) * 0.2)
    z = 1.1 * np.sin(x / 11) + 0.9 * np.cos(y / 9) + 0.05 * y + 0.01 * rng.normal(size=x.shape)
    z -= 0.5 * np.exp(-(((x - 45.0) / 0.8) ** 2)) * (y < 35.0)
    z[np.hypot(x - 60.0, y - 45.0) < 6.0] = np.nan
    sand, names = (np.abs(x - 25.0) < 4.0).astype(np.int64), ("", "<sand>")
    return ElevationMap(
        elevation=z,
        resolution=0.2,
        origin=(443000.0, 5410000.0),
        terrain_class=sand,
        class_names=names,
    )


@pytest.fixture(scope="module")
def plans(ground: ElevationMap) -> list[SpeedPlan]:
    start = np.array([443010.0, 5410040.0])
    paths = []
    for j, heading in enumerate(np.linspace(-0.4, 0.4, 50)):
        end = start + 60.0 * np.array([np.cos(heading), np.sin(heading)])
        paths.append(CandidatePath(EVIL if j == 30 else f"fan {j:02d}", np.stack((start, end))))
    answer = CandidatePlanner(MODEL).plan(ground, paths, start_speed=1.0, clear=50.0)
    return rank(answer, PlannerSettings())


def written(file: Path, ground: ElevationMap, plans: list[SpeedPlan], **texts: object) -> str:
    result = PlanResult(plans, ground, MODEL, 0.0)
    write_plan_page(file, result, **({"title": "t", "provenance": {}} | texts))
    return file.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def text(
    ground: ElevationMap, plans: list[SpeedPlan], tmp_path_factory: pytest.TempPathFactory
) -> str:
    facts = {"map": "hill.tif", "<b>odd</b>": "${body} & $data", "date": "2026-03-14"}
    file = tmp_path_factory.mktemp("pages") / "plans.html"
    return written(file, ground, plans, title=f"Hill {EVIL}", provenance=facts)


@pytest.fixture(scope="module")
def page(text: str) -> PageReader:
    return PageReader(text)


def test_page_has_its_parts_and_one_row_and_option_per_plan_in_their_order(
    page: PageReader, plans: list[SpeedPlan]
) -> None:
    ids = {attributes.get("id") for _, attributes in page.elements}
    assert {"map", "canvas", "relief", "charts", "table", "select", "cursor", "data"} <= ids
    assert page.all("html") == [{"lang": "en"}]
    assert any(meta.get("name") == "viewport" for meta in page.all("meta"))
    order = [str(i) for i in range(len(plans))]
    assert [row["data-plan"] for row in page.all("tr") if "data-plan" in row] == order
    assert [option["value"] for option in page.all("option")] == order
    buttons = zip(page.texts["button"], page.all("button"), strict=True)
    picks = [name for name, attributes in buttons if attributes.get("class") == "pick"]
    assert picks == [plan.candidate for plan in plans]


def test_page_loads_nothing(text: str, page: PageReader) -> None:
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
    assert "MIT License" in asset(VENDORED[2])


def test_page_runs_its_own_script_only(text: str, page: PageReader) -> None:
    policies = [m["content"] for m in page.all("meta") if "Security" in m.get("http-equiv", "")]
    (policy,) = policies
    assert policy.startswith("default-src 'none'")
    assert "unsafe-inline" not in policy.split("script-src")[1]
    assert "connect-src" not in policy
    assert [s for s in page.all("script") if s.get("type") != "application/json"] == [{}]
    body = text.rpartition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy


def test_names_stay_text(text: str, page: PageReader, plans: list[SpeedPlan]) -> None:
    assert "alert(1)</script>" not in text
    assert not any("onerror" in attributes for _, attributes in page.elements)
    assert page.texts["title"][0].startswith(f"Hill {EVIL}")
    assert page.texts["h1"] == [f"Hill {EVIL}"]
    assert "<b>odd</b>" in page.texts["dt"]
    assert "${body} & $data" in page.texts["dd"]
    data = embedded(text)
    assert [plan["name"] for plan in data["plans"]] == [plan.candidate for plan in plans]
    assert data["map"]["surfaces"][0]["name"] == "<sand>"


def test_statuses_and_bounds_have_names_meanings_and_signs_besides_colours(
    text: str, page: PageReader, plans: list[SpeedPlan]
) -> None:
    badges = [a for a in page.all("span") if (a.get("class") or "").startswith("badge")]
    assert [a["class"] for a in badges] == [f"badge {plan.status.value}" for plan in plans]
    assert set(BOUNDS) == set(Limiting)
    assert set(STATUS_MEANING) == set(Status)
    for status in Status:
        assert f'id="icon-{status.value}"' in text
        assert f".badge.{status.value}" in text
    for code in Limiting:
        assert f"--{code.label}:" in limit_colours()
        assert f'[data-limiting="{code.label}"]' in limit_colours()


def test_page_contains_the_map_north_up(page: PageReader, ground: ElevationMap) -> None:
    (picture,) = page.all("img")
    known = np.isfinite(ground.elevation)[::-1]
    np.testing.assert_array_equal(pixels_of(picture["src"] or "")[..., 1] == 255, known)


def test_page_is_written_as_utf_8_or_is_an_error(tmp_path: Path, ground: ElevationMap) -> None:
    plans = [plan_of("lone \ud800 surrogate, nul \x00, Ümläut")]
    assert "Ümläut" in written(tmp_path / "out.html", ground, plans, title="t \udcff")
    assert [p.name for p in tmp_path.iterdir()] == ["out.html"]
    with pytest.raises(InputError, match=r"out\.html"):
        written(tmp_path / "none" / "out.html", ground, plans)


def test_page_without_plans_says_so(tmp_path: Path, ground: ElevationMap) -> None:
    text = written(tmp_path / "none.html", ground, [])
    assert "There was no candidate" in text
    assert "<main hidden>" in text
    assert embedded(text)["plans"] == []


def test_columns_are_those_of_the_plans(
    text: str, plans: list[SpeedPlan], ground: ElevationMap
) -> None:
    for shown, plan in zip(embedded(text)["plans"], plans, strict=True):
        columns = shown["columns"]
        assert {len(values) for values in columns.values()} == {len(plan.station)}
        np.testing.assert_allclose(columns["speed"], plan.speed, atol=6e-4)
        np.testing.assert_allclose(columns["stop_distance"], plan.stop_distance, atol=6e-3)
        np.testing.assert_allclose(np.array(columns["x"]) + ground.origin[0], plan.x, atol=6e-3)
        np.testing.assert_array_equal(columns["limiting"], plan.limiting)
        assert shown["status"] == plan.status.value
        # A bound that is near the speed somewhere is shown, with the lowest of its speeds.
        assert Limiting.SPEED_LIMIT in {bound["code"] for bound in shown["bounds"]}
        for bound in shown["bounds"]:
            assert min(v for v in bound["speed"] if v is not None) < 1.3 * MODEL.limits.speed


def test_values_that_are_not_finite_become_null(tmp_path: Path, ground: ElevationMap) -> None:
    holes = np.where(np.arange(40) % 2, np.nan, np.inf)
    names = ("rear_load", "side_load", "stop_distance", "speed_bound", "z")
    plan = plan_of(**dict.fromkeys(names, holes), clear_distance=np.inf)
    text = written(tmp_path / "holes.html", ground, [plan])
    (shown,) = embedded(text)["plans"]
    assert (shown["margin"], shown["clear"]) == (None, None)
    assert set(shown["columns"]["rear_load"]) == {None}
    assert "nan" not in PageReader(text).texts["td"]
    plan = plan_of(status=Status.BLOCKED, speed=np.zeros(40), time=np.zeros(40))
    text = written(tmp_path / "rest.html", ground, [plan])
    (shown,) = embedded(text)["plans"]
    assert (shown["margin"], shown["progress"], shown["mean_speed"]) == (None, 0.0, None)
    assert "None of them may be driven" in text


def test_long_plans_are_thinned_but_keep_extremes() -> None:
    speed = np.full(50_000, 2.0)
    speed[31_234], speed[40_000:] = 0.5, 0.0
    load = np.where(np.arange(50_000) == 777, 0.2, 0.7)
    side_load = np.full(50_000, 0.9)
    plan = plan_of(stations=50_000, speed=speed, rear_load=load, side_load=side_load)
    indices = thinned(plan, 400)
    assert {0, 777, 31_234, 40_000, 49_999} <= set(indices.tolist())
    assert len(indices) < 600
    assert (np.diff(indices) > 0).all()


def test_pages_stay_small(text: str, tmp_path: Path, ground: ElevationMap) -> None:
    assert len(text.encode()) < 6e6
    plans = [plan_of(str(j), stations=4000) for j in range(50)]
    assert len(written(tmp_path / "long.html", ground, plans)) < 6e6


def test_json_cannot_end_its_element() -> None:
    value = {"a": "</script><!--\u2028&", "b": [1.5, None]}
    text = script_json(value)
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == value
    with pytest.raises(ValueError, match="not JSON compliant"):
        script_json(float("nan"))


def test_summary_has_the_numbers_of_a_plan_up_to_its_stop() -> None:
    plan = plan_of(limiting=np.r_[np.full(30, 7), np.full(10, 0)])
    summary = numbers_of(plan, 3)
    assert (summary["rank"], summary["longest_limit"]) == (3, Limiting.ACCEL)
    assert summary["progress"] == pytest.approx(plan.progress)
    assert summary["mean_speed"] == pytest.approx(plan.progress / plan.travel_time)
    assert summary["max_speed"] == pytest.approx(plan.speed.max())
    assert summary["margin"] == pytest.approx(plan.least_margin)
    assert summary["rear_load"] == pytest.approx(0.7)
    assert summary["limits_share"] == pytest.approx(30 / 39)
    speed = np.where(np.arange(40) < 20, 1.0, 0.0)
    loads = np.where(np.arange(40) > 25, 0.1, 0.6)
    assert numbers_of(plan_of(speed=speed, rear_load=loads), 1)["rear_load"] == 0.6


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
def test_verdict(statuses: str, sentence: str) -> None:
    status_of = {status.value[0]: status for status in Status}
    assert verdict([plan_of(status=status_of[letter]) for letter in statuses]) == sentence


def test_best_plan_is_the_first_that_may_be_driven() -> None:
    infeasible, blocked = plan_of(status=Status.INFEASIBLE), plan_of(status=Status.BLOCKED)
    assert best_plan([infeasible, blocked, blocked]) == 1
    assert best_plan([infeasible]) is None
