from __future__ import annotations

from pathlib import Path

import pytest

from slopewise.models.errors import InputError
from slopewise.services.cli.commands import params_diff
from slopewise.services.io.model_file import find_model

ATV = find_model("atv").read_text()


def changed(folder: Path, before: str, after: str) -> list[Path]:
    files = [folder / "a.toml", folder / "b.toml"]
    assert before in ATV
    for file, text in zip(files, (ATV, ATV.replace(before, after, 1)), strict=True):
        file.write_text(text)
    return files


def test_the_same_file_differs_in_nothing(tmp_path: Path) -> None:
    found = params_diff.run(changed(tmp_path, "b_b = 0.40", "b_b = 0.40"))
    assert found.keys == {}
    assert all(shift.least == shift.most == 0.0 for shift in found.stops)


def test_what_makes_stops_shorter_is_said_in_metres(tmp_path: Path) -> None:
    found = params_diff.run(changed(tmp_path, "b_b = 0.40", "b_b = 0.50"))
    assert found.keys == {"braking.b_b": (0.40, 0.50)}
    base = found.stops[0]
    assert base.surface == "base"
    assert base.least < base.most < 0.0
    told = params_diff.as_json(found)
    assert told["keys"]["braking.b_b"] == {"before": 0.40, "after": 0.50}


def test_two_files_are_needed(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="two model files"):
        params_diff.run(changed(tmp_path, "b_b = 0.40", "b_b = 0.50")[:1])
