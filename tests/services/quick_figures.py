"""Figures of pages without their layout, for tests that examine no figure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from slopewise.services.report import figures


@pytest.fixture(scope="module", autouse=True)
def quick_figures() -> Iterator[None]:
    """A layout takes half the time of a figure; the commands of README draw with it."""
    in_place = figures.svg_uri

    def without_layout(figure: Any) -> str:
        figure.set_layout_engine("none")
        return in_place(figure)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "svg_uri", without_layout)
        yield
