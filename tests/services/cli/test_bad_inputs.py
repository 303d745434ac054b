"""Every refusal of `tests/bad_inputs/commands.toml`."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.services.command_line import here, one_line_of

TABLE = tomllib.loads((Path(__file__).parents[2] / "bad_inputs" / "commands.toml").read_text())
CASES = [
    pytest.param(case, id=f"{kind}-{number}")
    for kind, cases in TABLE.items()
    for number, case in enumerate(cases)
]


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_one_line_and_status_2(world: Path, case: dict[str, Any]) -> None:
    for name, text in case.get("files", {}).items():
        (world / name).write_text(text)
    if "edits" in case:
        before, after = case["edits"]
        model = (world / "atv.toml").read_text()
        assert before in model
        (world / "model.toml").write_text(model.replace(before, after))
    one_line_of(here(*case["command"].split()), *case["expected"])
