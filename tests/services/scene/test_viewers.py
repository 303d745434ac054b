"""Plans for viewers: MCAP read by mcap and protobuf alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("foxglove", reason="the viz extra is not installed")

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from slopewise.services.scene import foxglove_file
from tests.world.ground import plane, straight
from tests.world.vehicles import ATV, model_of

BEGIN = 1_800_000_000_123_456_789


@pytest.fixture(scope="module")
def planned() -> tuple[ElevationMap, list[SpeedPlan], Model]:
    model = model_of(ATV)
    ground = plane(0.05, 0.02)
    paths = [straight(20.0, name="left"), straight(30.0, 0.05, name="right")]
    return ground, CandidatePlanner(model).plan(ground, paths), model


def test_a_surface_has_holes_where_ground_is_unknown() -> None:
    heights = np.add.outer(0.1 * np.arange(6), 0.2 * np.arange(5))
    heights[2, 2] = np.nan
    ground = ElevationMap(elevation=heights, resolution=0.5, origin=(3.0, -1.0))
    vertices, triangles, *_ = foxglove_file.mesh(ground)
    assert vertices.shape == (29, 3)
    x, y, z = vertices.T
    np.testing.assert_allclose(z, 0.2 * (y + 1.0) + 0.4 * (x - 3.0), atol=1e-12)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = 0.5 * np.cross(b - a, c - a)[:, 2]
    np.testing.assert_allclose(area, 0.125)  # all seen from above, half a cell each
    # Six of the eight half cells around the unknown corner's four cells are holes: those with it.
    assert len(triangles) == 2 * 20 - 6
    middles = (a + b + c)[:, :2] / 3.0
    assert not np.any(np.hypot(*(middles - [4.0, 0.0]).T) < 0.2)


def test_large_ground_is_drawn_coarser() -> None:
    ground = ElevationMap(elevation=np.zeros((300, 400)), resolution=0.5, origin=(0.0, 0.0))
    vertices = foxglove_file.mesh(ground, max_vertices=1000)[0]
    assert len(vertices) <= 1200
    assert vertices[:, 0].max() > 0.95 * ground.extent[1]


def test_colours_follow_speed_as_far_as_a_plan_drives(planned: Any) -> None:
    ground, plans, model = planned
    (stopped,) = CandidatePlanner(model).plan(ground, [straight(20.0)], clear=8.0)
    colours = foxglove_file.colours_of(stopped, max(plan.speed.max() for plan in plans))
    is_driven = np.any(colours != foxglove_file.NOT_DRIVEN, axis=1)
    assert stopped.station[is_driven][-1] == pytest.approx(stopped.progress)
    np.testing.assert_array_equal(is_driven, stopped.station <= stopped.progress + 1e-9)
    top = int(np.argmax(stopped.speed))
    assert colours[top].astype(int).sum() > colours[0].astype(int).sum()


def test_attitude_follows_the_ground(planned: Any) -> None:
    """On a plane z = 0.1 x, driven along x, the body's axes are those of the slope."""
    heights = np.broadcast_to(0.05 * np.arange(60.0), (60, 60))
    ground = ElevationMap(elevation=heights, resolution=0.5, origin=(-5.0, -15.0))
    (plan,) = CandidatePlanner(planned[2]).plan(ground, [straight(20.0)])
    x, y, z, w = foxglove_file.attitudes(plan)[5]
    ahead = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
    np.testing.assert_allclose(ahead, np.array([1.0, 0.0, 0.1]) / np.hypot(1.0, 0.1), atol=1e-6)


def messages_in(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Messages by topic; protobuf is decoded with the schema that is in the file itself."""
    reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    messages: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as stream:
        for schema, channel, message in reader.make_reader(
            stream, validate_crcs=True
        ).iter_messages():
            if schema.encoding == "jsonschema":
                decoded = json.loads(message.data)
                assert set(decoded) == set(json.loads(schema.data)["properties"])
            else:
                files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
                pool = descriptor_pool.DescriptorPool()
                for file in files.file:
                    pool.Add(file)
                kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
                decoded = kind.FromString(message.data)
                assert schema.name.startswith("foxglove.")
            messages.setdefault(channel.topic, []).append((message.log_time, decoded))
    return messages


def test_mcap_holds_what_was_planned(planned: Any, tmp_path: Path) -> None:
    ground, plans, model = planned
    file = tmp_path / "plan.mcap"
    foxglove_file.write_mcap(file, ground, plans, model.vehicle, BEGIN)
    messages = messages_in(file)
    assert set(messages) == {"/map", "/candidates", "/vehicle", "/tf", "/plan"}
    ((_, scene),) = messages["/candidates"]
    assert [entity.id for entity in scene.entities] == ["left", "right"]
    for entity, plan in zip(scene.entities, plans, strict=True):
        (line,) = entity.lines
        assert len(line.points) == len(line.colors) == len(plan.station)
        np.testing.assert_allclose([p.x for p in line.points], plan.x)
        assert entity.frame_id == "map"
    best = plans[0]
    rows = messages["/plan"]
    np.testing.assert_allclose([row["speed_m_s"] for _, row in rows], best.speed[: len(rows)])
    times = np.array([at - BEGIN for at, _ in rows]) * 1e-9
    np.testing.assert_allclose(times, best.time[: len(rows)], atol=1e-8)
    assert min(row["margin_m"] for _, row in rows[:-1]) >= 0.0
    last = messages["/tf"][-1][1]
    assert (last.parent_frame_id, last.child_frame_id) == ("map", "vehicle")
    assert last.translation.x == pytest.approx(float(best.x[len(rows) - 1]))
    ((_, map_scene),) = messages["/map"]
    (triangles,) = map_scene.entities[0].triangles
    assert len(triangles.points) == np.isfinite(ground.elevation).sum()
    assert max(triangles.indices) == len(triangles.points) - 1
