"""The page of `slopewise plan`: map, candidates, and what limits each of them where.

One HTML file that works offline: relief, plans, style and script are all inside. It is drawn by a
script of its own; verdict and table of candidates are plain HTML and can be read without it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.explain.explain import Explanation
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.io.files import write_atomic
from slopewise.services.report.limit_colours import limit_colours
from slopewise.services.report.page import asset, escaped, fact_list, page
from slopewise.services.report.plan_data import page_data
from slopewise.services.report.plan_reasons import reasons
from slopewise.services.report.plan_summary import PlanSummary, chosen, summarise, verdict
from slopewise.services.report.png import data_uri
from slopewise.services.report.words import LIMITING_MEANING, STATUS_MEANING, word

_SCRIPTS = (
    "helpers.js",
    "state.js",
    "axes.js",
    "map.js",
    "charts.js",
    "details.js",
    "table.js",
    "main.js",
)
_NONE = '<td class="number" data-value="">–</td>'


def write_report(
    path: Path,
    elevation_map: ElevationMap,
    plans: Sequence[SpeedPlan],
    model: Model,
    *,
    title: str,
    provenance: Mapping[str, str],
    explanation: Explanation | None = None,
) -> None:
    """Write the page of some plans, all or nothing.

    Args:
        path: HTML file to write.
        elevation_map: ground that was planned on.
        plans: best first; their order is their rank.
        model: vehicle and limits that were planned with.
        title: what was planned, in a few words.
        provenance: map, paths, date and whatever else tells the page from others: name -> value.
        explanation: of the best plan, None to leave it out.

    Raises:
        InputError: the file cannot be written.
    """
    text = render_report(
        elevation_map, plans, model, title=title, provenance=provenance, explanation=explanation
    )
    write_atomic(path, text.encode("utf-8", "replace"))


def render_report(
    elevation_map: ElevationMap,
    plans: Sequence[SpeedPlan],
    model: Model,
    *,
    title: str,
    provenance: Mapping[str, str],
    explanation: Explanation | None = None,
) -> str:
    """The page as text; see :func:`write_report`."""
    summaries = [summarise(plan, rank) for rank, plan in enumerate(plans, start=1)]
    best = chosen(plans)
    picture, data = page_data(elevation_map, plans, summaries, model, best)
    fields = {
        "title": escaped(title),
        "verdict": escaped(verdict(plans)),
        "choice": _choice(summaries, best),
        "provenance": fact_list(provenance),
        "model": fact_list(model_facts(model)),
        "model_name": escaped(model.name),
        "relief": data_uri(picture),
        "options": "".join(
            f'<option value="{i}">{s.rank} · {escaped(s.name)} · {s.status.value}</option>'
            for i, s in enumerate(summaries)
        ),
        "rows": "\n".join(_row(i, summary) for i, summary in enumerate(summaries)),
        "reasons": reasons(explanation),
        "icons": asset("icons.svg"),
        "empty": "" if plans else " hidden",
    }
    return page(
        "plan.html",
        fields,
        title=f"{title} – slopewise plan",
        styles=("page.css", "colours.css", "plan.css", "reasons.css"),
        own_style=limit_colours(),
        scripts=_SCRIPTS,
        data=data,
    )


def model_facts(model: Model) -> dict[str, str]:
    """What a reader wants to know of the model that a plan was made with."""
    vehicle, braking, limits = model.vehicle, model.braking, model.limits
    low, high = np.rad2deg(braking.grade_range)
    slow, fast = braking.speed_range
    facts = {
        "vehicle": f"{vehicle.mass:g} kg, {vehicle.drive.replace('_', '-')}, wheelbase "
        f"{vehicle.wheelbase:g} m, track {vehicle.track_width:g} m, "
        f"centre of gravity {vehicle.cg_z:g} m high",
        "braking on level ground": f"{braking.level_force(fast) * braking.share_at():.0%} of the "
        f"weight after a dead time of {braking.dead_time:g} s",
        "trained for": f"{slow:g} … {fast:g} m/s, grades of {low:.1f}° … {high:.1f}°",
        "limits": f"{limits.speed:g} m/s, +{limits.accel:g} and −{limits.decel:g} m/s², "
        f"{limits.jerk:g} m/s³, {limits.lateral_accel:g} m/s² sideways, "
        f"{limits.min_load:.0%} of the static load on every axle and side, "
        f"{model.max_path_deviation:.3g} m from the given path",
    }
    if model.effect:
        facts["effects"] = ", ".join(effect.name for effect in model.effect)
    return facts


def _choice(summaries: Sequence[PlanSummary], best: int | None) -> str:
    if not summaries:
        return ""
    if best is None:
        return "None of them may be driven."
    s = summaries[best]
    name = f"<strong>{escaped(s.name)}</strong>"
    if s.status is Status.DEGRADED:
        name += f" ({s.status.value})"
    way = f"{s.progress:.1f} m"
    if s.status is not Status.OK and s.progress < s.length - 0.05:
        way += f" of {s.length:.1f} m"
    time = "" if s.travel_time is None else f" in {s.travel_time:.1f} s"
    top = "" if s.max_speed is None else f", at most {s.max_speed:.2f} m/s"
    return f"Best: {name}, {way}{time}{top}."


def badge(status: Status) -> str:
    """A status as a coloured word with a sign of its own."""
    name = status.value
    return (
        f'<span class="badge {name}" title="{escaped(STATUS_MEANING[status])}">'
        f'<svg aria-hidden="true"><use href="#icon-{name}"/></svg>{name}</span>'
    )


def _row(index: int, s: PlanSummary) -> str:
    share = "" if s.limits_most is None else f" {s.limits_share:.0%}"
    limits = "–"
    if s.limits_most is not None:
        limits = (
            f'<span class="swatch" data-limiting="{s.limits_most.label}"></span>'
            f'<span title="{escaped(LIMITING_MEANING.get(s.limits_most, ""))}">'
            f"{escaped(word(s.limits_most))}</span><small>{share}</small>"
        )
    cells = (
        f'<td class="number" data-value="{s.rank}">{s.rank}</td>',
        f'<th scope="row" data-value="{escaped(s.name)}">'
        f'<button type="button" class="pick">{escaped(s.name)}</button></th>',
        f'<td data-value="{list(Status).index(s.status)}">{badge(s.status)}</td>',
        '<td class="spark"></td>',
        _number(s.travel_time, ".1f"),
        _number(s.progress, ".1f", f"<small> / {s.length:.1f}</small>"),
        _number(s.mean_speed, ".2f"),
        _number(s.max_speed, ".2f"),
        _number(s.margin, ".2f"),
        _number(s.rear_load, ".0%"),
        _number(s.path_deviation, ".2f"),
        f'<td data-value="{"" if s.limits_most is None else escaped(word(s.limits_most))}">'
        f"{limits}</td>",
        f'<td class="reason" data-value="{escaped(s.reason)}">{escaped(s.reason) or "–"}</td>',
    )
    return f'<tr data-plan="{index}">{"".join(cells)}</tr>'


def _number(value: float | None, form: str, behind: str = "") -> str:
    if value is None:
        return _NONE
    text = f"{value:{form}}".replace("-", "−")
    return f'<td class="number" data-value="{value:.6g}">{text}{behind}</td>'
