"""Every refusal of `tests/bad_inputs/commands.toml`."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.services.command_line import here, one_line_of

TABLES = tomllib.loads((Path(__file__).parents[2] / "bad_inputs" / "commands.toml").read_text())
CASES = [
    pytest.param(table, row, id=f"{number}-{row_number}")
    for number, table in enumerate(TABLES["table"])
    for row_number, row in enumerate(table["rows"])
]


@pytest.mark.parametrize(("table", "row"), CASES)
def test_bad_input_is_one_line_and_status_2(
    world: Path, table: dict[str, Any], row: list[str]
) -> None:
    text, *expected = row
    if table.get("file") == "model.toml":
        before, after = text.split(" -> ")
        model = (world / "atv.toml").read_text()
        assert before in model
        text = model.replace(before, after)
    if "file" in table:
        (world / table["file"]).write_text(text)
    one_line_of(here(*table["command"].replace("{}", text).split()), *expected)
