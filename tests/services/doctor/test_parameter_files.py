"""Parameter files of Nav2 and of the edge: what is read, and what is refused."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from math import nan
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.models.errors import InputError
from slopewise.services.doctor.examine import examine
from slopewise.services.doctor.nav2_file import read_nav2
from slopewise.services.doctor.robot_facts import IssueSeverity, RobotFacts
from slopewise.services.io.model_file import find_model
from slopewise.services.ros.settings import EdgeSettings, Topics
from tests.services.command_line import here, one_line_of
from tests.services.doctor.test_doctor import MODEL, NAV2, change, parameters


def places(table: dict[str, Any], *outer: str) -> Iterator[tuple[str, ...]]:
    for key, value in table.items():
        yield (*outer, key)
        if isinstance(value, dict):
            yield from places(value, *outer, key)


def test_values_of_a_wrong_kind_end_no_check(tmp_path: Path) -> None:
    odd = [
        "",
        "text",
        True,
        [],
        {},
        {"x": 1},
        0,
        -1,
        nan,
        [None],
        [[1]],
        "[[1, 2], [3, 4], [5, a]]",
    ]
    for place in places(NAV2):
        for value in odd:
            nodes = copy.deepcopy(NAV2)
            change(*place, to=value)(nodes)
            examine(RobotFacts(MODEL, EdgeSettings(), parameters(tmp_path, nodes)))


def test_files_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    for text, fact in (
        ("a: [", "expected YAML"),
        ("[" * 20_000, "expected YAML"),
        ("&a\nb: *a\n", "expected YAML"),
        ("a: 1\n", "parameters of nodes"),
    ):
        file = tmp_path / "p.yaml"
        file.write_text(text)
        with pytest.raises(InputError, match=fact):
            read_nav2([file])
    assert here("doctor").returncode == 2
    assert here("doctor", "--live", "1").returncode == 2


def test_settings_of_the_edge_are_examined_by_themselves(tmp_path: Path) -> None:
    settings, model = tmp_path / "ros.toml", find_model("atv")
    settings.write_text("[stop]\ndeceleration = 6.0\n")
    done = here("doctor", "--config", settings, "--model", "atv", "--json")
    assert done.returncode == 3, done.stderr
    assert [f["check"] for f in json.loads(done.stdout)["findings"]] == ["the edge's own stop"]
    one_line_of(here("doctor", "--config", settings), "--config with --model")
    one_line_of(here("doctor", model), f"{model}: expected a GeoTIFF")


def test_parameter_names_with_dots_and_namespaces_are_nested(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(
        "/r1/controller_server:\n  ros__parameters:\n    controller_plugins: [F]\n"
        "    F.ax_min: -1.0\n    F:\n      vx_max: 2.0\n"
    )
    nav2 = read_nav2([file])
    assert nav2.controllers() == {"F": {"ax_min": -1.0, "vx_max": 2.0}}
    assert all(f.severity is IssueSeverity.ERROR for f in examine(RobotFacts(MODEL, None, nav2)))


def test_parameters_of_all_nodes_count_for_each(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("/**:\n  ros__parameters:\n    use_sim_time: true\n    max_decel: [-9.5]\n")
    facts = RobotFacts(MODEL, EdgeSettings(topics=Topics(speed_limit="other")), read_nav2([file]))
    (issue,) = examine(facts)
    assert issue.message.startswith("velocity_smoother counts on 9.5 m/s²")
