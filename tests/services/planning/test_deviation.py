"""How far a plan leads from the path that was asked for is in the reply, and in what is shown."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import ParameterError
from slopewise.services.io.map_file import write_map_npz
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.path_file import write_paths_csv
from slopewise.services.io.table import read_csv
from slopewise.services.jobs import demo
from slopewise.services.parameters.limits_group import LimitsGroup
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire import codec, plan_messages
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import PlanReply, PlanRequest
from tests.services.command_line import here, one_line_of
from tests.services.planning.plan_requests import flat_snapshot, plan_service

LIMIT = 0.3  # [m] a quarter of the atv's width
THERE = np.arange(0.0, 5.0, 0.1)
BACK = np.stack([np.concatenate([THERE, THERE[-2::-1], THERE[1:]]), np.full(148, 0.0)], axis=1)
"""To and fro in short steps: it is planned up to where it turns round."""


def slalom(amplitude: float, turn: float = 0.4) -> np.ndarray:
    points = np.stack([np.arange(24.0), np.resize([0.0, 1.0, 0.0, -1.0], 24) * amplitude], axis=1)
    cosine, sine = np.cos(turn), np.sin(turn)
    return points @ np.array([[cosine, sine], [-sine, cosine]])


def asked(client: str = "") -> PlanReply:
    paths = [("slalom", slalom(0.8)), ("gentle", slalom(0.05)), ("back", BACK)]
    request = PlanRequest(
        speed=0.0,
        client=client,
        pose=(0.0, 0.0, 0.4) if client else None,
        paths=[plan_messages.Path(name=name, points=points) for name, points in paths],
    )
    return plan_service().answer(request, flat_snapshot(), "plan")


@pytest.mark.parametrize("client", ["", "robot"])
def test_a_reply_reports_it_and_where_a_path_turns_round(client: str) -> None:
    reply = asked(client)
    # A cycle finishes as many plans as its time allows.
    reported = {plan.candidate for plan in reply.plans}
    assert reported == {"slalom", "gentle", "back"} if not client else reported
    for plan in reply.plans:
        assert ("turns round at (4.90, 0.00)" in plan.reason) == (plan.candidate == "back")
    for plan in reply.plans:
        deviation = plan.path_deviation
        assert 0.0 <= deviation.largest <= deviation.limit == pytest.approx(LIMIT)
        k = int(np.argmin(np.abs(plan.column("station") - deviation.station)))
        assert plan.column("x")[k] == pytest.approx(deviation.x)
        assert plan.column("y")[k] == pytest.approx(deviation.y)


def test_a_reply_without_it_is_still_read() -> None:
    reply, encoding = asked(), codec.encoding_of(PlanReply, Format.JSON)
    plain = msgspec.json.decode(codec.encode(reply, Format.JSON))
    for is_old in (False, True):
        for plan in plain["plans"] if is_old else ():
            del plan["path_deviation"]
        read = codec.decode(PlanReply, msgspec.json.encode(plain), encoding, "plan", 2**24)
        known = None if is_old else reply.plans[0].path_deviation
        assert read.plans[0].path_deviation == known


def test_an_operator_may_only_tighten_the_limit() -> None:
    model = read_model(find_model("atv"))
    group = LimitsGroup(model, Learning())
    assert group.describe("limits").values["max_path_deviation"] == model.max_path_deviation
    assert group.apply(model) == model
    with pytest.raises(ParameterError, match=r"at most the 0\.3 of the model file"):
        group.set("limits", {"max_path_deviation": 0.5})
    group.set("limits", {"max_path_deviation": 0.1})
    assert group.apply(model).max_path_deviation == 0.1


@pytest.mark.parametrize(
    ("width", "given", "limit"),
    [(1.2, None, 0.3), (None, None, 0.299), (0.12, None, 0.05), (1.2, 0.02, 0.02)],
)
def test_the_limit_is_a_quarter_of_the_width_if_the_model_names_none(
    width: float | None, given: float | None, limit: float
) -> None:
    model = read_model(find_model("atv"))
    track = min(model.vehicle.track_width, width or 1.0)
    vehicle = replace(model.vehicle, width=width, track_width=track)
    limits = replace(model.limits, max_path_deviation=given)
    model = replace(model, vehicle=vehicle, limits=limits)
    assert model.max_path_deviation == pytest.approx(limit)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("deviation")
    write_map_npz(demo.hillside(), folder / "map.npz")
    return folder


def planned(
    folder: Path, *paths: CandidatePath, options: tuple[object, ...] = ()
) -> tuple[int, str]:
    write_paths_csv(paths, folder / "paths.csv")
    done = here("plan", folder / "map.npz", folder / "paths.csv", "--model", "atv", *options)
    return done.returncode, done.stdout + done.stderr


def test_json_csv_page_and_screen_show_it(folder: Path) -> None:
    begin = demo.fan()[0].points[0]
    path = CandidatePath("slalom", begin + slalom(0.55)[:12])
    files = ("--out", folder / "plan.csv", "--report", folder / "page.html")
    _, text = planned(folder, path, options=("--json", *files))
    data = json.loads(text)
    (plan,) = data["plans"]
    reported = plan["path_deviation"]
    assert set(reported) == {"largest", "station", "x", "y", "limit", "sentence"}
    assert 0.075 < reported["largest"] <= reported["limit"] == pytest.approx(LIMIT)
    assert max(plan["columns"]["path_deviation"]) <= reported["largest"]
    deviation = read_csv(folder / "plan.csv").numbers("path_deviation", "m")
    np.testing.assert_array_equal(deviation, plan["columns"]["path_deviation"])
    assert any("plans lead at most 0.3 m from a given path" in note for note in data["notes"])
    assert "assumed without [tracking]: exactly on the line, without delay" in data["notes"]
    page = (folder / "page.html").read_text()
    assert f">{reported['largest']:.2f}</td>" in page
    _, text = planned(folder, path)
    assert "1 candidate, best first" in text
    sentence = f"planned up to {reported['largest']:.2f} m away from the given path"
    assert sentence in " ".join(text.split())


def test_a_refused_path_refuses_no_file(folder: Path) -> None:
    points = demo.fan()[0].points
    steps = np.diff(points, axis=0)
    heading = np.append(np.arctan2(steps[:, 1], steps[:, 0]), 0.0)
    ahead = CandidatePath("ahead", points, yaw=heading)
    back = CandidatePath("back", points, yaw=heading + np.pi)
    status, text = planned(folder, back, ahead, options=("--json",))
    data = json.loads(text)
    assert status == 0
    assert [plan["candidate"] for plan in data["plans"]] == ["ahead"]
    (refused,) = data["refused"]
    assert (refused["candidate"], refused["status"]) == ("back", "refused")
    assert "driven backwards" in refused["reason"]
    _, text = planned(folder, back, ahead)
    assert "back: refused: back.yaw: expected" in " ".join(text.split())
    write_paths_csv([back], folder / "paths.csv")
    done = here("plan", folder / "map.npz", folder / "paths.csv", "--model", "atv")
    one_line_of(done, "paths.csv", "back.yaw", "driven backwards")


def test_where_a_plan_stops_is_one_number(folder: Path) -> None:
    _, text = planned(folder, *demo.fan(), options=("--json",))
    _, table = planned(folder, *demo.fan())
    blocked = [plan for plan in json.loads(text)["plans"] if plan["status"] == "blocked"]
    assert blocked
    for plan in blocked:
        stop, length = f"{plan['progress']:.1f}", f"{plan['length']:.1f}"
        assert plan["reason"].startswith(f"stops at {stop} m of {length} m: ")
        assert "stops before" not in plan["reason"]
        assert f"{stop}/{length}" in table
        place = re.search(r" (?:ahead at|up to) (\d+\.\d\d) m", plan["reason"])
        assert place
        assert float(place[1]) > plan["progress"]
    assert "stops at" in table
