"""Files of every kind that cannot be used: one line that names the file and the field."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.errors import InputError
from slopewise.services.io.drive_log import read_drive_log, read_logs
from slopewise.services.io.model_file import read_model
from slopewise.services.io.path_file import read_paths
from slopewise.services.io.plan_file import read_external_plans
from slopewise.services.ros.settings import read_settings
from slopewise.services.settings.service_settings import read_config
from tests.services.faults import bad_inputs, fault_in

READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "drive_log": ("log.csv", lambda path: read_drive_log([path])),
    "geojson": ("p.geojson", read_paths),
    "model_text": ("m.toml", read_model),
    "paths": ("p.csv", read_paths),
    "plans": ("p.csv", read_external_plans),
    "ros": ("ros.toml", read_settings),
    "service": ("service.toml", read_config),
    "topics": ("topics.toml", lambda path: read_logs([path.with_name("drive.mcap")], path)),
}
CASES = [(kind, *case) for kind in READERS for case in bad_inputs(kind)]


@pytest.mark.parametrize(
    ("kind", "content", "field", "message"),
    [
        *CASES,
        ("model_text", b"\xff\xfe", "byte 0", "UTF-8"),
        ("model_text", b"name = \x00", "line 1, column 8", "expected TOML"),
        ("model_text", "a = " + "[" * 5000, "", "expected TOML"),
        ("paths", b"x,y\n\xff\xff", "byte 4", "UTF-8"),
        ("paths", b"\x89PNG\r\n\x1a\n\x00\x00", "byte 0", "UTF-8"),
        ("geojson", "[" * 100_000, "", "expected JSON"),
    ],
)
def test_the_error_names_file_and_field(
    tmp_path: Path, kind: str, content: str | bytes, field: str, message: str
) -> None:
    name, read = READERS[kind]
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with fault_in(path, field, message):
        read(path)


@pytest.mark.parametrize("kind", READERS)
def test_a_missing_file_is_named(tmp_path: Path, kind: str) -> None:
    name, read = READERS[kind]
    with fault_in(tmp_path / name, "", "expected an existing file"):
        read(tmp_path / name)


@settings(deadline=None)
@given(
    kind=st.sampled_from(("drive_log", "geojson", "paths", "plans")),
    content=st.binary(max_size=40)
    | st.text(alphabet='x,y\n"1.e-;', max_size=40)
    | st.text(alphabet='0123.,-\n"runtvcmdpi_ e', max_size=60).map(
        lambda text: f"run,t,v,v_cmd,pitch,x,y,speed\n{text}"
    ),
)
def test_any_bytes_are_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, kind: str, content: str | bytes
) -> None:
    name, read = READERS[kind]
    path = tmp_path_factory.mktemp("any") / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    try:
        read(path)
    except InputError as error:
        assert str(error).isprintable()  # noqa: PT017  either outcome is right
