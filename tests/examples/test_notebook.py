"""The notebook runs from its first cell to its last, and gives the output that it stores."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
FILE = ROOT / "examples" / "from_map_to_discrepancy.ipynb"
LARGEST = 100_000


def texts_of(cells: Any) -> list[list[str]]:
    """Words of every cell's results, without numbers and what a table's width depends on."""
    outputs = [[out["data"]["text/plain"] for out in cell.get("outputs", [])] for cell in cells]
    return [re.findall(r"[A-Za-z_]{3,}", "".join(texts)) for texts in outputs]


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::RuntimeWarning")
def test_it_runs_and_shows_what_is_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("nbclient", reason="nbclient is not installed")
    monkeypatch.syspath_prepend(ROOT / "docs" / "site")
    import nbformat
    import notebook

    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    stored = nbformat.read(FILE, as_version=4)
    now = notebook.executed(tmp_path)
    assert notebook.FILE == FILE
    assert texts_of(now.cells) == texts_of(stored.cells), "docs/site/notebook.py stores the outputs"
    assert sum(bool(texts) for texts in texts_of(now.cells)) >= 6


def test_it_is_small_and_says_nothing_of_a_machine() -> None:
    text = FILE.read_text()
    assert len(text) < LARGEST
    assert not re.search("/(home|work|tmp)", text)
