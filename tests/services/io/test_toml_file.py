from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from slopewise.services.io.files import read_toml, resolve_names
from tests.services.faults import fault_in


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("a = 1\n[b\n", "line 2, column 3", "expected TOML, got: Expected ']'"),
        ("a = ", "end of document", "expected TOML"),
        ("a = 1\na = 2\n", "line 2, column 6", "Cannot overwrite"),
        ("a = " + "[" * 5000, "", "expected TOML"),
    ],
)
def test_the_line_that_is_wrong_is_named(
    tmp_path: Path, text: str, place: str, message: str
) -> None:
    file = tmp_path / "a.toml"
    file.write_text(text)
    with fault_in(file, place, message):
        read_toml(file)


def test_file_names_are_resolved_and_other_names_stay(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("")
    (tmp_path / "folder").mkdir()
    data: dict[str, Any] = {
        "model": "mine.toml",
        "map": "",
        "zenoh": {"config": "gone.json5"},
        "ros": 3,
        "learning": {"terrains": "folder"},
        "service": {"config": ["mine.toml"]},
        "store": {"path": "new.sqlite"},
    }
    keys = ("model", "map", "zenoh.config", "ros.config", "learning.terrains", "service.config")
    settings = tmp_path / "service.toml"
    resolve_names(settings, data, *keys, "none.config")
    resolve_names(settings, data, "store.path", "ros.path", exists=False)
    assert data == {
        "model": str(tmp_path / "mine.toml"),
        "map": "",
        "zenoh": {"config": "gone.json5"},
        "ros": 3,
        "learning": {"terrains": "folder"},
        "service": {"config": ["mine.toml"]},
        "store": {"path": str(tmp_path / "new.sqlite")},
    }
