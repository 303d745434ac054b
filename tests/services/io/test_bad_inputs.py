"""Files of every kind that cannot be used: one line that names the file and the field."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from slopewise.services.io.drive_log import read_drive_log, read_logs
from slopewise.services.io.path_file import read_paths
from slopewise.services.io.plan_file import read_external_plans
from slopewise.services.ros.settings import read_settings
from slopewise.services.settings.service_settings import read_config
from tests.services.faults import bad_inputs, fault_in

READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "drive_log": ("log.csv", lambda path: read_drive_log([path])),
    "geojson": ("p.geojson", read_paths),
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
