"""Maps and paths of recordings: written by rosbags, and public ones decoded by hand."""

from __future__ import annotations

import json
import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from rosbags.rosbag2 import StoragePlugin, Writer

from slopewise.models.errors import InputError, ParameterError
from slopewise.services.io import grid_map
from slopewise.services.io.bag_paths import read_bag_paths
from slopewise.services.io.bags import GRID_MAP, PATH, read_cdr, type_hashes, typestore
from slopewise.services.io.grid_map import elevation_map_of
from slopewise.services.io.map_file import frame_of, map_info, read_map
from slopewise.services.io.path_file import read_paths
from tests.services import grid_maps
from tests.services.command_line import here
from tests.services.faults import fault_in

RNG = np.random.default_rng(11)
HEIGHTS = RNG.normal(0.0, 1.0, (7, 5)).astype(np.float32)
LINE = np.stack([np.linspace(-4.0, 4.0, 30), np.zeros(30)], axis=1)
RECORDINGS = ("grid_map_ros2_db3", "traversability_gridmap_mcap")


def bag(folder: Path, *messages: tuple[str, str, Any], plugin: Any = StoragePlugin.MCAP) -> Path:
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for n, (topic, kind, message) in enumerate(messages):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=typestore())
            writer.write(connections[topic], n, typestore().serialize_cdr(message, kind))
    return folder


@pytest.mark.parametrize("start", [(0, 0), (3, 0), (0, 4), (6, 2)])
@pytest.mark.parametrize("by_column", [True, False])
def test_cells_lie_where_the_message_says(start: tuple[int, int], by_column: bool) -> None:
    message = grid_maps.grid_map(HEIGHTS, 0.5, (10.0, -3.0), start=start, by_column=by_column)
    ground = elevation_map_of(message)
    for row in range(7):
        for column in range(5):
            x, y = 10.0 + 1.75 - 0.25 - 0.5 * row, -3.0 + 1.25 - 0.25 - 0.5 * column
            i, j = round((y - ground.origin[1]) / 0.5), round((x - ground.origin[0]) / 0.5)
            assert ground.elevation[i, j] == HEIGHTS[row, column]


def test_cells_without_a_basic_layer_are_unknown() -> None:
    partial = np.zeros((7, 5))
    partial[2, 3] = np.nan
    message = grid_maps.grid_map(HEIGHTS, more={"seen": partial}, basic=("elevation", "seen"))
    known = np.isfinite(elevation_map_of(message).elevation)
    assert np.count_nonzero(~known) == 1
    assert not known[::-1, ::-1].T[2, 3]


def error_of(**layers: np.ndarray) -> float:
    return elevation_map_of(grid_maps.grid_map(HEIGHTS, 0.5, more=layers)).height_std


def test_a_variance_is_how_far_heights_are_off() -> None:
    std = RNG.uniform(0.01, 0.1, HEIGHTS.shape).astype(np.float32)
    expected = pytest.approx(float(np.quantile(std, 0.95)), rel=1e-4)
    assert error_of(variance=std**2) == expected
    untold = np.where(std < 0.02, np.nan, std**2)
    assert error_of(variance=untold) >= error_of(variance=std**2) > 0.0
    # Bounds are those of the fused map; the variance of a raw one goes before them.
    bounds = {"lower_bound": HEIGHTS - 2.0 * std, "upper_bound": HEIGHTS + 2.0 * std}
    assert error_of(**bounds) == expected
    assert error_of(variance=0.0 * std + 0.01, **bounds) == pytest.approx(0.1)


def test_a_place_that_is_off_is_a_height_that_is_off_on_a_slope() -> None:
    rows, columns = np.meshgrid(np.arange(7), np.arange(5), indexing="ij")
    slope = (0.5 * (0.3 * rows - 0.1 * columns)).astype(np.float32)
    flat = np.full(slope.shape, 0.01)
    message = grid_maps.grid_map(
        slope,
        0.5,
        more={"variance": flat, "horizontal_variance_x": flat, "horizontal_variance_y": 4.0 * flat},
    )
    expected = np.sqrt(0.01 * (1.0 + 0.3**2 + 4.0 * 0.1**2))
    assert elevation_map_of(message).height_std == pytest.approx(expected, rel=1e-5)


def test_layers_without_an_error_are_ignored() -> None:
    assumed = pytest.approx(0.045)
    assert error_of() == assumed
    zero = np.zeros_like(HEIGHTS)
    assert error_of(upper_bound=zero, lower_bound=zero) == assumed
    assert error_of(variance=zero * np.nan) == assumed
    assert error_of(upper_bound=zero + 9.0) == assumed


@pytest.mark.parametrize(
    ("change", "field", "message_part"),
    [
        (lambda m: setattr(m.info, "resolution", float("nan")), "info.resolution", "> 0"),
        (lambda m: setattr(m.info, "length_x", 3.3), "info.length_x", "whole cells"),
        (lambda m: setattr(m, "outer_start_index", 7), "outer_start_index", "0 … 6"),
        (lambda m: setattr(m, "inner_start_index", 5), "inner_start_index", "0 … 4"),
        (lambda m: setattr(m, "layers", ["colour"]), "layers", "got colour"),
        (lambda m: setattr(m, "layers", ["elevation", "b"]), "data", "2 layers"),
        (lambda m: setattr(m, "basic_layers", ["b"]), "basic_layers", "got b"),
        (lambda m: setattr(m.data[0], "data", m.data[0].data[1:]), "data[0]", "7 x 5"),
        (lambda m: setattr(m.data[0].layout, "dim", []), "data[0].layout.dim", "got none"),
        (lambda m: setattr(m.data[0].layout.dim[0], "size", 6), "data[0].layout.dim", "7 x 6"),
        (lambda m: setattr(m.info.pose.orientation, "z", 0.7), "info.pose.orientation", "axes"),
        (lambda m: setattr(m.info.pose.position, "x", float("inf")), "info.pose.position", "fin"),
    ],
)
def test_grid_maps_that_cannot_be_used(change: Any, field: str, message_part: str) -> None:
    message = grid_maps.grid_map(HEIGHTS)
    change(message)
    with pytest.raises(ParameterError, match=message_part) as error:
        elevation_map_of(message)
    assert error.value.field == field


def test_bytes_too_few_or_too_many_are_refused() -> None:
    raw = bytes(typestore().serialize_cdr(grid_maps.path(LINE, pose_frame="map"), PATH))
    assert len(read_cdr(raw, PATH, "here", "").poses) == len(LINE)
    for cut in [*range(0, 12), *range(len(raw) // 2, len(raw) // 2 + 40), len(raw) - 1]:
        with pytest.raises(InputError):
            read_cdr(raw[:cut], PATH, "here", "")
    for tail in (b"\0" * 8, b"\0\1", b"\1", b"abc"):
        with pytest.raises(InputError, match="after it"):
            read_cdr(raw + tail, PATH, "here", "")
    assert read_cdr(raw + b"\0\0\0", PATH, "here", "")


def test_a_text_that_is_cut_off_is_refused() -> None:
    kind = "std_msgs/msg/String"
    raw = bytes(typestore().serialize_cdr(typestore().types[kind]("abcdef"), kind))
    with pytest.raises(InputError, match=r"cut off|too few"):
        read_cdr(raw[:-3], kind, "here", "")


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_the_last_map_of_a_recording(tmp_path: Path, plugin: Any) -> None:
    maps = [grid_maps.grid_map(HEIGHTS + n, start=(n, n)) for n in range(3)]
    recording = bag(tmp_path / "b", *(("/map", GRID_MAP, m) for m in maps), plugin=plugin)
    ground = read_map(recording)
    np.testing.assert_array_equal(ground.elevation, (HEIGHTS + 2.0)[::-1, ::-1].T)
    assert map_info(recording).rows == 5
    mapping = tmp_path / "topics.toml"
    mapping.write_text('[map]\ntopic = "/map"\nmessage = 1\n')
    np.testing.assert_array_equal(
        read_map(recording, topics=mapping).elevation, (HEIGHTS + 1.0)[::-1, ::-1].T
    )
    mapping.write_text("[map]\nmessage = 3\n")
    with fault_in(recording, "topic /map", "message 3 of 3"):
        read_map(recording, topics=mapping)
    mapping.write_text("[map]\ntopics = 3\n")
    with fault_in(mapping, "map.topics", "unknown key, did you mean topic?"):
        read_map(recording, topics=mapping)


def test_a_recorded_map_is_decoded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Grid, frame and heights need one decoding, until the recording is another one."""
    recording = bag(tmp_path / "b", ("/map", GRID_MAP, grid_maps.grid_map(HEIGHTS)))
    decoded = []
    plain = elevation_map_of
    monkeypatch.setattr(
        grid_map, "elevation_map_of", lambda *given: decoded.append(1) or plain(*given)
    )
    assert frame_of(recording) == "map"
    assert map_info(recording).rows == 5
    assert read_map(recording).elevation.shape == (5, 7)
    assert len(decoded) == 1
    shutil.rmtree(recording)
    bag(recording, ("/map", GRID_MAP, grid_maps.grid_map(HEIGHTS + 1.0)))
    np.testing.assert_array_equal(read_map(recording).elevation, (HEIGHTS + 1.0)[::-1, ::-1].T)
    assert len(decoded) == 2


def test_what_cannot_be_guessed_is_asked(tmp_path: Path) -> None:
    message = grid_maps.grid_map(HEIGHTS)
    recording = bag(tmp_path / "b", ("/a", GRID_MAP, message), ("/b", GRID_MAP, message))
    with fault_in(recording, "topics", "/a, /b"):
        read_map(recording)
    with fault_in(recording, "topics", "a topic of nav_msgs/msg/Path, got /a (grid_map_msgs"):
        read_paths(recording)


def test_paths_of_a_recording(tmp_path: Path) -> None:
    paths = [grid_maps.path(LINE + np.array([0.0, n])) for n in range(3)]
    recording = bag(
        tmp_path / "b",
        ("/plan", PATH, paths[0]),
        ("/plan", PATH, paths[1]),
        ("/two", PATH, paths[2]),
    )
    last = read_paths(recording)
    assert [c.name for c in last] == ["/plan", "/two"]
    assert last[0].points[0, 1] == 1.0
    mapping = tmp_path / "topics.toml"
    mapping.write_text('[paths]\ntopics = ["/plan"]\nall_messages = true\n')
    assert [c.name for c in read_paths(recording, mapping)] == ["/plan#0", "/plan#1"]
    with fault_in(recording, "/plan, header.frame_id", "expected frame odom", "got map"):
        read_bag_paths(recording, None, "odom")
    moved = bag(tmp_path / "c", ("/p", PATH, grid_maps.path(LINE, pose_frame="base_link")))
    with fault_in(moved, "/p, header.frame_id", "got base_link"):
        read_bag_paths(moved, None, "map")
    empty = bag(tmp_path / "d", ("/p", PATH, grid_maps.path(LINE[:1])))
    with fault_in(empty, "/p, points", "at least 2 points"):
        read_paths(empty)


def test_plan_over_a_recording(tmp_path: Path) -> None:
    rows, columns = np.indices((60, 40))
    ground = grid_maps.grid_map(0.02 * (rows + columns), 0.25, start=(17, 5))
    recording = bag(
        tmp_path / "b", ("/elevation", GRID_MAP, ground), ("/plan", PATH, grid_maps.path(LINE))
    )
    done = here("plan", recording, recording, "--model", "atv", "--json")
    assert done.returncode == 0, done.stderr
    (plan,) = json.loads(done.stdout)["plans"]
    assert (plan["candidate"], plan["status"]) == ("/plan", "ok")


def test_the_hash_that_a_public_recording_states() -> None:
    """The older definition's hash as a recorder wrote it into a public MCAP file."""
    stated = "RIHS01_9eff3e400537c303d797eddfff64e4508e9deac21a0f076c5dcb11ffc198f671"
    assert stated == type_hashes(GRID_MAP)[1]
    assert len(type_hashes(PATH)) == 1


@pytest.mark.parametrize("name", RECORDINGS)
def test_public_recordings_cell_by_cell(data: Path, name: str) -> None:
    folder = data / "bags" / name
    if not folder.is_dir():
        pytest.skip(f"no recording at {folder}")
    pytest.importorskip("mcap", reason="the ros extra is not installed")
    by_hand = grid_maps.decode(grid_maps.last_raw(folder))
    ground = read_map(folder)
    rows, columns = by_hand.layers["elevation"].shape
    assert ground.elevation.shape == (columns, rows)
    known = 0
    for row in range(rows):
        for column in range(columns):
            x, y, z = by_hand.height(row, column)
            i = (y - ground.origin[1]) / ground.resolution
            j = (x - ground.origin[0]) / ground.resolution
            assert abs(i - round(i)) < 1e-9
            assert abs(j - round(j)) < 1e-9
            np.testing.assert_equal(ground.elevation[round(i), round(j)], z)
            known += np.isfinite(z)
    assert known == np.isfinite(ground.elevation).sum()
    assert (known < 0.2 * rows * columns) == (name == RECORDINGS[0])


@pytest.mark.parametrize("name", RECORDINGS)
def test_public_recordings_are_planned_on_and_pictured(
    data: Path, name: str, tmp_path: Path
) -> None:
    folder = data / "bags" / name
    if not folder.is_dir():
        pytest.skip(f"no recording at {folder}")
    paths, page, scene = tmp_path / "p.csv", tmp_path / "p.html", tmp_path / "p.mcap"
    paths.write_text(
        "candidate,x,y\nedge,0.9,-1.0\nedge,0.9,1.2\nmiddle,0.0,-1.0\nmiddle,0.0,1.0\n"
    )
    if name == RECORDINGS[0]:  # letters in unknown ground: nothing to stand on
        paths.write_text("candidate,x,y\nmiddle,0.0,-1.0\nmiddle,0.0,1.0\n")
    out = ["--out", scene] if find_spec("foxglove") is not None else []
    done = here("plan", folder, paths, "--model", "husky", "--json", "--report", page, *out)
    plans = {plan["candidate"]: plan for plan in json.loads(done.stdout)["plans"]}
    assert done.returncode == 3, done.stderr
    if name == RECORDINGS[0]:
        assert "unknown ground" in plans["middle"]["reason"]
    else:
        assert plans["edge"]["status"] == "blocked"
        assert "is outside the trained" in plans["edge"]["reason"]  # it lies 18° across
        assert "under the front overhang" in plans["middle"]["reason"]  # a step of 0.4 m
    assert "<svg" in page.read_text() or "<canvas" in page.read_text()
    assert not out or scene.stat().st_size > 10_000
