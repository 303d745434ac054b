from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import MapUpdate, Path, PlanRequest
from tests.services.faults import fault_in

KEY = "robot/v1/plan"
MAX_BYTES = 1_000_000


def request(**changes: object) -> PlanRequest:
    points = np.array([[0.0, 0.0], [1.0, 0.25], [2.0, 1.0]])
    fields: dict[str, object] = {"speed": 1.5, "paths": [Path(name="a", points=points)]}
    return PlanRequest(**(fields | changes))  # type: ignore[arg-type]


def read(payload: bytes, encoding: str | None = None, max_bytes: int = MAX_BYTES) -> PlanRequest:
    if encoding is None:
        encoding = codec.encoding_of(PlanRequest, Format.MESSAGEPACK)
    return codec.decode(PlanRequest, payload, encoding, KEY, max_bytes)


@pytest.mark.parametrize("written", Format)
def test_every_number_survives_the_way(written: Format) -> None:
    points = np.random.default_rng(1).normal(size=(100, 2))
    sent = request(paths=[Path(name="a", points=points, speed_limit=points[:, 0] ** 2)])
    got = read(codec.encode(sent, written), codec.encoding_of(PlanRequest, written))
    np.testing.assert_array_equal(got.paths[0].points, points)
    np.testing.assert_array_equal(got.paths[0].speed_limit, points[:, 0] ** 2)
    assert got.speed == 1.5
    assert not got.paths[0].points.flags.writeable or written is Format.JSON


def test_blocks_are_little_endian_float64_as_anybody_reads_them() -> None:
    raw = msgspec.msgpack.decode(codec.encode(request(), Format.MESSAGEPACK))
    block = raw["paths"][0]["points"]
    assert block["shape"] == [3, 2]
    assert list(np.frombuffer(block["data"], "<f8")) == [0.0, 0.0, 1.0, 0.25, 2.0, 1.0]
    big_endian = request(paths=[Path(name="a", points=np.arange(6.0).reshape(3, 2).astype(">f8"))])
    got = read(codec.encode(big_endian, Format.MESSAGEPACK))
    np.testing.assert_array_equal(got.paths[0].points, np.arange(6.0).reshape(3, 2))


@pytest.mark.parametrize("written", Format)
@pytest.mark.parametrize("kind", [np.float64, np.float32, np.longdouble, np.array])
def test_numbers_of_numpy_are_numbers(written: Format, kind: Any) -> None:
    sent = request(speed=kind(1.5), pose=(kind(1.0), kind(2.5), 0.0), sequence=np.int64(7))
    plain = request(speed=1.5, pose=(1.0, 2.5, 0.0), sequence=7)
    assert codec.encode(sent, written) == codec.encode(plain, written)


def test_unknown_ground_is_null_for_people() -> None:
    heights = np.array([[0.0, np.nan], [1.0, 2.0]])
    sent = MapUpdate(source="s", sequence=1, elevation=heights, resolution=1.0, origin=(0.0, 0.0))
    payload = codec.encode(sent, Format.JSON)
    assert b"[[0.0,null],[1.0,2.0]]" in payload
    got = codec.decode(MapUpdate, payload, "application/json", "m", MAX_BYTES)
    np.testing.assert_array_equal(got.elevation, heights)


def mutated(**changes: object) -> bytes:
    raw = msgspec.msgpack.decode(codec.encode(request(), Format.MESSAGEPACK))
    return msgspec.msgpack.encode(raw | changes)


def points(value: object) -> bytes:
    return mutated(paths=[{"name": "a", "points": value}])


@pytest.mark.parametrize(
    ("payload", "field", "expected"),
    [
        (b"", "", "expected slopewise.plan_request.v1"),
        (b"\xc1", "", "expected slopewise.plan_request.v1"),
        (b"\x93\x01\x02\x03", "", "object"),
        (mutated(speed="fast"), "speed", "float"),
        (mutated(speed=float("nan")), "speed", "finite"),
        (mutated(pose=[0.0, float("inf"), 0.0]), "pose[1]", "finite"),
        (mutated(clear=-1.0), "clear", ">= 0"),
        (mutated(sequence=-1), "sequence", ">= 0"),
        (mutated(sequence=2**63), "sequence", "int"),
        (mutated(colour=1), "colour", "unknown field"),
        (mutated(client="x" * 121), "client", "<= 120"),
        (mutated(paths=[{"name": "a"}]), "paths[0].points", "got none"),
        (points({"shape": [3, 2], "data": b"\0" * 40}), "paths[0].points", "got 40 bytes"),
        (points({"shape": [2**40, 2**40], "data": b""}), "paths[0].points", "shape"),
        (points({"shape": [-1, 2], "data": b""}), "paths[0].points", "shape"),
        (points({"shape": [1, 1, 1], "data": b"\0" * 8}), "paths[0].points", "shape"),
        (points({"data": b"\0" * 8}), "paths[0].points.shape", "got none"),
        (points([[1.0, 2.0], [3.0]]), "paths[0].points", "one length"),
        (points([["1", "2"]]), "paths[0].points", "str"),
    ],
)
def test_errors_name_the_field(payload: bytes, field: str, expected: str) -> None:
    with fault_in(KEY, field, expected):
        read(payload)


@pytest.mark.parametrize("encoding", ["", "text/plain", "application/msgpack", "zenoh/bytes"])
def test_format_and_schema_are_required(encoding: str) -> None:
    with fault_in(KEY, "encoding", "expected"):
        read(codec.encode(request(), Format.MESSAGEPACK), encoding)


def test_other_major_versions_are_refused() -> None:
    encoding = "application/msgpack;slopewise.plan_request.v2"
    with fault_in(KEY, "encoding", "slopewise.plan_request.v1", "v2"):
        read(codec.encode(request(), Format.MESSAGEPACK), encoding)


def test_people_may_leave_the_schema_out() -> None:
    assert read(codec.encode(request(), Format.JSON), "application/json").speed == 1.5


def test_a_large_payload_is_not_decoded() -> None:
    class Heavy:
        def __len__(self) -> int:
            return 10**12

    with fault_in(KEY, "", "at most 1000000 bytes"):
        read(Heavy())  # type: ignore[arg-type]


EMPTY_ROWS = [
    msgspec.msgpack.encode({"speed": 1.0, "paths": [{"name": "a", "points": [row] * count}]})
    for row, count in (([], 150_000), ([0, 0], 70_000), ([0] * 15, 10_000), (0, 150_000))
]


@pytest.mark.parametrize("payload", EMPTY_ROWS, ids=["empty", "pairs", "wide", "numbers"])
def test_lists_are_counted_before_they_are_decoded(payload: bytes) -> None:
    with fault_in(KEY, "paths[0].points", "at most 125000 numbers"):
        read(payload)
    as_json = msgspec.json.encode(msgspec.msgpack.decode(payload))
    with fault_in(KEY, "paths[0].points", f"at most {len(as_json) // 8} numbers"):
        read(as_json, "application/json", len(as_json))


def test_many_small_lists_are_counted_together() -> None:
    paths = [{"name": str(i), "points": [[0, 0]] * 1000} for i in range(100)]
    with fault_in(KEY, "paths[62].points", "at most 125000 numbers"):
        read(mutated(paths=paths))


def test_a_row_longer_than_the_first_is_refused_before_it_is_decoded() -> None:
    with fault_in(KEY, "paths[0].points", "length <= 1"):
        read(points([[0], [0] * 900_000]))


def test_a_message_is_checked_before_its_arrays_are_decoded() -> None:
    def refuse(message: PlanRequest) -> None:
        raise InputError(KEY, "paths", f"got {len(message.paths)}")

    encoding = codec.encoding_of(PlanRequest, Format.MESSAGEPACK)
    payload = points([["no number"]])
    with fault_in(KEY, "paths", "got 1"):
        codec.decode(PlanRequest, payload, encoding, KEY, MAX_BYTES, check=refuse)


def test_deep_nesting_is_an_error_and_no_crash() -> None:
    with pytest.raises(InputError):
        read(b'{"speed":' + b"[" * 200_000, "application/json")
