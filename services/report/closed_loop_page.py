"""The page of `slopewise bench closed-loop`: what was wanted and reached, stops, policies, a drive.

One HTML file that works offline and without a script.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from slopewise.services.io.files import write_atomic
from slopewise.services.report.page import escaped, fact_list, number_row, page
from slopewise.services.report.png import data_uri

_COEFFICIENTS = ("m_m", "b_m", "m_b", "b_b", "distance_offset")


def write_report(
    path: Path,
    result: Mapping[str, Any],
    columns: Sequence[tuple[str, str, str]],
    pictures: Mapping[str, bytes],
) -> None:
    """Write the page, all or nothing.

    Args:
        path: HTML file to write.
        result: figures of the benchmark, as in its JSON.
        columns: title, key and form of each figure of a policy that is shown.
        pictures: PNG by name: ``stops``, ``policies``, ``drive``.

    Raises:
        InputError: the file cannot be written.
    """
    write_atomic(path, render_report(result, columns, pictures).encode("utf-8", "replace"))


def render_report(
    result: Mapping[str, Any],
    columns: Sequence[tuple[str, str, str]],
    pictures: Mapping[str, bytes],
) -> str:
    """The page as text; see :func:`write_report`."""
    policies = result["policies"]
    fields = {
        "title": escaped(f"Closed loop in a physics engine: {result['ground']}"),
        "verdict": escaped(_verdict(result["targets"])),
        "facts": fact_list(
            {
                "drives": str(sum(row["drives"] for row in policies.values())),
                "forced stops": str(sum(row["forced_stops"] for row in policies.values())),
                "way": f"{sum(row['distance'] for row in policies.values()) / 1000.0:.1f} km",
                "dead time learned": " and ".join(
                    f"{model['dead_time']:.3f} s" for model in result["learned"].values()
                ),
            }
        ),
        "wanted": "\n".join(_target(row) for row in result["targets"]),
        "columns": "".join(f'<th class="number">{escaped(title)}</th>' for title, _, _ in columns),
        "rows": "\n".join(
            number_row(name, [form.format(row[key]) for _, key, form in columns])
            for name, row in policies.items()
        ),
        "learned": "\n".join(
            number_row(f"{name}: {surface}", [f"{found[key]:+.4f}" for key in _COEFFICIENTS])
            for name, model in result["learned"].items()
            for surface, found in model["surfaces"].items()
        ),
        **{name: data_uri(picture) for name, picture in pictures.items()},
    }
    return page(
        "closed_loop.html",
        fields,
        title="slopewise closed loop",
        styles=("page.css", "calibration.css"),
        scripts=(),
        data=None,
    )


def _verdict(targets: Sequence[Mapping[str, Any]]) -> str:
    missed = [row["what"] for row in targets if not row["passed"]]
    if not missed:
        return f"All {len(targets)} targets were reached."
    return f"{len(missed)} of {len(targets)} targets were missed: {'; '.join(missed)}."


def _target(row: Mapping[str, Any]) -> str:
    sign = {">=": "≥", "<=": "≤"}[row["relation"]]
    reached = "yes" if row["passed"] else "no"
    return number_row(row["what"], [f"{sign} {row['wanted']:g}", f"{row['reached']:.4g}", reached])
