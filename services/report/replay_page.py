"""The page of `slopewise replay --plan`: speeds over time, place of slow-downs, latencies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from slopewise.services.jobs.plural import plural
from slopewise.services.jobs.replay_plan import ReplayResult
from slopewise.services.jobs.replay_summary import CauseRow, ReplaySummary
from slopewise.services.report.figures import FAINT, FIRST, INK, SECOND, THIRD, draw_figures
from slopewise.services.report.page import MAX_ROWS, write_page


def write_replay_page(
    path: Path, result: ReplayResult, summary: ReplaySummary, *, bag: str, model: str
) -> None:
    """Write the page, all or nothing; recording and model as stated."""
    received = [f"{n} {kind}" for kind, n in summary.received.items()]
    values = {
        "title": bag,
        "verdict": verdict(summary),
        "facts": {
            "model": f"{summary.model} ({model})",
            "received": ", ".join(received[:6]),
            "cycles": f"{summary.cycles} of {summary.period:g} s in {summary.driven:.1f} s",
        },
        "notices": summary.notices,
        "statuses": cause_cells(summary.statuses, none="–"),
        "guard": cause_cells(summary.guard, none="–"),
        "slowed": slowed_cells(summary)[:MAX_ROWS],
        "more_slowed": len(summary.slowed) - MAX_ROWS,
        "pictures": draw_figures(
            speeds=((7.4, 3.8), lambda figure: _draw_speeds(figure, result)),
            track=((7.4, 5.0), lambda figure: _draw_track(figure, result)),
            latency=((7.4, 3.0), lambda figure: _draw_latency(figure, result)),
        ),
    }
    write_page(path, "replay.html", values, "replay")


def verdict(summary: ReplaySummary) -> str:
    p99 = 1e3 * summary.latency["p99"]
    return (
        f"Plans took {1e3 * summary.latency['median']:.1f} ms in the median, {p99:.1f} ms at 99 %; "
        f"{plural(summary.late, 'cycle')} took longer than {summary.period:g} s. The driver would "
        f"have been slowed in {plural(len(summary.slowed), 'place')}, for "
        f"{summary.slowed_seconds:.1f} s in all."
    )


def cause_cells(rows: list[CauseRow], of: str = "", none: str = "") -> list[tuple[str, ...]]:
    """Rows on statuses: `of` whom and status, first reason or `none`, cycles, time of the first."""
    return [(of + r.status, r.example or none, str(r.cycles), f"{r.first:.1f}") for r in rows]


def slowed_cells(summary: ReplaySummary) -> list[tuple[str, ...]]:
    """Rows on slow-downs: from, to, place, driven and planned speed, reason."""
    return [
        (
            f"{r.begin:.1f}",
            f"{r.end:.1f}",
            "–" if r.x is None or r.y is None else f"{r.x:.1f}, {r.y:.1f}",
            f"{r.driven:.2f}",
            f"{r.limit:.2f}",
            f"{r.status}: {r.reason}" if r.reason else r.status,
        )
        for r in summary.slowed
    ]


def _draw_speeds(figure: Any, result: ReplayResult) -> None:
    axes = figure.add_subplot()
    t = [c.time for c in result.cycles]
    axes.plot(t, [c.pose.speed for c in result.cycles], color=INK, lw=1.2, label="driven")
    axes.plot(t, [c.limit for c in result.cycles], color=FIRST, lw=1.0, label="planned")
    guard = [abs(c.decision.command.speed) for c in result.cycles]
    axes.plot(t, guard, color=THIRD, lw=0.8, label="passed by the guard")
    low, high = axes.get_ylim()
    slow = [c.slows for c in result.cycles]
    axes.fill_between(t, low, high, where=slow, color=SECOND, alpha=0.12, lw=0, step="mid")
    axes.set(xlabel="time, s", ylabel="speed, m/s", ylim=(low, high))
    axes.legend(ncols=3, fontsize=8.5)


def _draw_track(figure: Any, result: ReplayResult) -> None:
    axes = figure.add_subplot()
    x, y = np.array([(c.pose.x, c.pose.y) for c in result.cycles]).T
    axes.plot(x, y, color=FAINT, lw=1.0)
    slow = np.array([c.slows for c in result.cycles])
    axes.scatter(x[slow], y[slow], s=12, color=SECOND)
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    axes.set_adjustable("datalim")


def _draw_latency(figure: Any, result: ReplayResult) -> None:
    axes = figure.add_subplot()
    t = [c.time for c in result.cycles]
    axes.semilogy(
        t, [1e3 * c.plan_seconds for c in result.cycles], color=FIRST, lw=0.8, label="plan"
    )
    axes.semilogy(
        t, [1e3 * c.guard_seconds for c in result.cycles], color=THIRD, lw=0.8, label="guard"
    )
    axes.axhline(1e3 * result.period, color=SECOND, lw=1.0, ls="--", label="period")
    axes.set(xlabel="time, s", ylabel="duration, ms")
    axes.legend(ncols=3, fontsize=8.5)
