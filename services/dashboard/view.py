"""Messages thinned to what the scripts of the live page draw. Positions are the map's."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from slopewise.services.dashboard.live_state import LiveState, ProposalEntry
from slopewise.services.wire.parameter_messages import HistoryEntry
from slopewise.services.wire.plan_messages import Plan, PlanReply, PlanRequest, ServiceStatus

_MAX_STATIONS = 240
"""Stations of the chosen plan [1], two per pixel of a small screen's chart."""

_MAX_OTHER_PLANS, _OTHER_POINTS = 60, 24
"""Other candidates on the map, and points of each [1]: lines that a browser draws quickly."""

_PLAN_NUMBERS = ("travel_time", "progress", "least_margin", "least_rear_load")
_STOP_NUMBERS = ("speed", "grade", "predicted", "actual")
_OFFER_FIELDS = ("id", "verdict", "summary", "at", "stops", "cause", "notes")
_COLUMNS = ("station", "x", "y", "speed", "speed_bound", "stop_distance")
_DECIMALS, _PARAMETER_DECIMALS = 3, 5
"""Decimals of numbers on the page [1]: of millimetres, and of coefficients of braking."""


def state(status: ServiceStatus, page: LiveState) -> dict[str, Any]:
    """Page data that change with every plan: status and last plan."""
    return {
        "status": msgspec.to_builtins(status),
        "changes": page.changes,
        "plan": page.plan and _plan(*page.plan),
    }


def _plan(request: PlanRequest, reply: PlanReply, at: float) -> dict[str, Any]:
    plans = {plan.candidate: plan for plan in reply.plans}
    chosen = plans.get(reply.chosen or "")
    unchosen = [plan for plan in reply.plans if plan is not chosen][:_MAX_OTHER_PLANS]
    return {
        "age": time.monotonic() - at,
        "client": request.client,
        "speed": _rounded(request.speed),
        "pose": request.pose and _rounded(list(request.pose)),
        "status": reply.status,
        "reason": reply.reason,
        "kept": reply.kept,
        "candidates": len(reply.ranking),
        "refused": sum(not candidate.usable for candidate in reply.ranking),
        "command": msgspec.to_builtins(reply.command),
        "planner": _rounded(reply.seconds.get("planner", math.nan)),
        "chosen": chosen and _chosen_plan(chosen),
        "others": [_path(plan, ("x", "y"), _OTHER_POINTS) for plan in unchosen],
    }


def _chosen_plan(plan: Plan) -> dict[str, Any]:
    stations = _spread(plan.values.shape[1], _MAX_STATIONS)
    firsts = np.array([limit.first for limit in plan.limits])
    codes = np.searchsorted(firsts, stations, side="right") - 1
    return {
        "reason": plan.reason,
        **{name: _rounded(getattr(plan, name)) for name in _PLAN_NUMBERS},
        "length": _rounded(float(plan.column("station")[-1])),
        "clear": _rounded(plan.clear_distance),
        "limiting": [plan.limits[code].name for code in codes],
        **_path(plan, _COLUMNS, _MAX_STATIONS),
    }


def _path(plan: Plan, columns: Sequence[str], count: int) -> dict[str, Any]:
    stations, met = _spread(plan.values.shape[1], count), plan.obstacle
    return {
        "name": plan.candidate,
        "status": plan.status,
        "obstacle": met and {"x": _rounded(met.x), "y": _rounded(met.y), "bound": met.bound},
        **{name: _rounded(plan.column(name)[stations].tolist()) for name in columns},
    }


def learned(page: LiveState) -> dict[str, Any]:
    """Page data that change rarely: parameters with their history, terrain, stops, proposal."""
    return {
        # Read first, so that what arrives meanwhile is loaded once more, and not missed.
        "changes": page.changes,
        "groups": [_group(changes) for changes in page.groups.values()],
        "ground": page.ground and _ground(*page.ground),
        "stops": [
            {
                **{name: _rounded(getattr(stop, name)) for name in _STOP_NUMBERS},
                "surface": stop.surface,
                "outcome": stop.outcome,
                "version": version,
                "at": at,
            }
            for stop, version, at in page.stops
        ],
        "finding": page.proposal and _finding(page.proposal),
    }


def _ground(name: str, probability: float, at: float) -> dict[str, Any]:
    return {"name": name, "probability": _rounded(probability), "at": at}


def _finding(entry: ProposalEntry) -> dict[str, Any]:
    offer, numbers = entry.offer, entry.offer.numbers()
    gap = numbers.stop_distance
    return {
        "state": entry.state,
        "words": entry.message,
        "purpose": entry.purpose,
        "command": entry.command,
        "effects": msgspec.to_builtins(numbers.effects),
        "before": gap.before,
        "after": gap.after,
        "floor": gap.noise_floor,
        "longer": _rounded([offer.beside_file.least, offer.beside_file.most]),
        **{name: getattr(offer, name) for name in _OFFER_FIELDS},
    }


def _group(changes: Sequence[HistoryEntry]) -> dict[str, Any]:
    last = changes[-1]

    def rows(tables: Iterable[dict[str, float]]) -> Any:
        # By name: in the past a group may have had other parameters.
        rows = [[table.get(name) for name in last.values] for table in tables]
        return _rounded(rows, _PARAMETER_DECIMALS)

    return {
        **{name: getattr(last, name) for name in ("group", "valid", "version", "cause")},
        "names": list(last.values),
        "at": [change.at for change in changes],
        "value": rows(change.values for change in changes),
        "std": rows(change.stds for change in changes),
    }


def _spread(count: int, max_count: int) -> NDArray[np.int64]:
    """Uniform indices from first to last, at most ``max_count``."""
    if count <= max_count:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, max_count).round().astype(np.int64))


def _rounded(value: Any, decimals: int = _DECIMALS) -> Any:
    """A number or list as JSON holds it: rounded, None where it is not finite."""
    if isinstance(value, list):
        return [_rounded(item, decimals) for item in value]
    return round(float(value), decimals) if value is not None and math.isfinite(value) else None
