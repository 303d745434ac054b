from __future__ import annotations

from pathlib import Path
from typing import Any

from slopewise.services.io.files import resolve_names


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
