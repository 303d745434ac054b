"""The plan page in a browser: charts, cursor, keyboard and table of a page with its script."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.jobs.plan import PlanResult
from slopewise.services.report.plan_page import write_plan_page
from tests.services import browser

SCRIPT = """
<script>
setTimeout(() => {
  const element = (id) => document.getElementById(id);
  const plots = [...document.querySelectorAll(".uplot")];
  const lineOf = (plot) => getComputedStyle(plot.querySelector(".u-cursor-x"));
  const cross = () => plots.map((plot) => new DOMMatrix(lineOf(plot).transform).e);
  const slider = () => Number(element("charts").getAttribute("aria-valuenow"));
  const key = (name, shiftKey = false) => {
    const event = new KeyboardEvent("keydown", { key: name, shiftKey, bubbles: true });
    element("charts").dispatchEvent(event);
    return slider();
  };
  const isInked = (canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return data.some((value) => value > 0);
  };
  const inked = plots.map((plot) => isInked(plot.querySelector("canvas")));
  const seen = { plots: plots.length, inked };
  seen.home = key("Home");
  seen.homeCross = cross();
  seen.right = key("ArrowRight");
  seen.shifted = key("ArrowRight", true);
  seen.end = key("End");
  seen.endCross = cross();
  const over = plots[2].querySelector(".u-over");
  const box = over.getBoundingClientRect();
  const place = { clientX: box.left + box.width / 2, clientY: box.top + 5, bubbles: true };
  over.dispatchEvent(new PointerEvent("pointermove", place));
  seen.middle = slider();
  seen.text = element("charts").getAttribute("aria-valuetext");
  seen.cursor = element("cursor").textContent;
  const keys = [...document.querySelectorAll(".chart .keys")];
  seen.keys = keys.map((node) => node.textContent);
  const table = element("table");
  const heads = [...table.tHead.querySelectorAll("button")];
  heads.find((button) => button.textContent.startsWith("mean speed")).click();
  seen.sorted = [...table.tBodies[0].rows].map((row) => Number(row.cells[6].dataset.value));
  table.tBodies[0].rows[1].click();
  seen.selected = element("select").value;
  seen.sparks = document.querySelectorAll(".spark path").length;
  document.body.dataset.seen = JSON.stringify(seen);
  document.body.dataset.ready = "true";
}, 300);
</script>
"""


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """State of the page after keys, a pointer and clicks; its policy is lifted for the script."""
    x = np.arange(0.0, 60.0, 0.5)
    heights = np.tile(np.sin(x / 8.0), (60, 1))
    ground = ElevationMap(elevation=heights, resolution=0.5, origin=(0.0, 0.0))
    paths = [
        CandidatePath(f"to {y:g}", np.array([[5.0, 15.0], [50.0, y]])) for y in (10.0, 15.0, 20.0)
    ]
    model = read_model(find_model("atv"))
    plans = CandidatePlanner(model).plan(ground, paths, start_speed=1.0, clear=40.0)
    file: Path = tmp_path_factory.mktemp("browser") / "plan.html"
    write_plan_page(file, PlanResult(plans, ground, model, 0.0), "t", {})
    text = re.sub(r'<meta http-equiv="Content-Security-Policy".*?>', "", file.read_text())
    file.write_text(text.replace("</body>", SCRIPT + "</body>"))
    shown = browser.text_of(file.as_uri())
    match = re.search(r'data-seen="(.*?)"', shown)
    state: dict[str, Any] = json.loads(match[1].replace("&quot;", '"'))
    return state


def test_six_charts_are_drawn(seen: dict[str, Any]) -> None:
    assert seen["plots"] == 6
    assert all(seen["inked"])
    assert seen["sparks"] == 9


def test_keys_move_one_cursor_through_all_charts(seen: dict[str, Any]) -> None:
    assert seen["home"] == 0.0
    assert seen["homeCross"] == pytest.approx([0.0] * 6, abs=1.0)
    assert seen["right"] == pytest.approx(0.25, abs=0.05)
    assert seen["shifted"] == pytest.approx(11 * seen["right"], abs=0.1)
    assert seen["end"] > 45.0
    assert seen["endCross"] == pytest.approx([seen["endCross"][0]] * 6, abs=1.0)
    assert seen["endCross"][0] > 300.0


def test_pointer_shows_the_values_at_its_station(seen: dict[str, Any]) -> None:
    assert seen["middle"] == pytest.approx(seen["end"] / 2.0, abs=0.6)
    assert "limited by" in seen["text"]
    assert re.search(r"station2\d\.\d\d", seen["cursor"])
    assert re.search(r"speed\d\.\d\d", seen["keys"][0])
    assert "rear axle" in seen["keys"][2]


def test_table_sorts_and_selects(seen: dict[str, Any]) -> None:
    assert seen["sorted"] == sorted(seen["sorted"])
    assert seen["selected"] in {"0", "1", "2"}
