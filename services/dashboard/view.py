"""What the script of the live page draws, as JSON holds it. Positions are the map's."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from slopewise.services.dashboard.board import Board, FindingSeen, GroupSeen, PlanSeen
from slopewise.services.wire.plan_messages import ObstacleMessage, Plan, ServiceStatus

_MOST_STATIONS = 240
_MOST_OTHERS = 60
_OTHER_POINTS = 24
_COLUMNS = ("station", "x", "y", "speed", "speed_bound", "stop_distance")
_DECIMALS = 3


def state(status: ServiceStatus, board: Board) -> dict[str, Any]:
    """What changes all the time: status, and the last plan."""
    seen = board.plan
    return {
        "status": msgspec.to_builtins(status),
        "changes": board.changes,
        "plan": None if seen is None else _answer(seen),
    }


def _answer(seen: PlanSeen) -> dict[str, Any]:
    request, reply = seen.request, seen.reply
    plans = {plan.candidate: plan for plan in reply.plans}
    chosen = plans.get(reply.chosen or "")
    others = [plan for plan in reply.plans if plan is not chosen][:_MOST_OTHERS]
    command = reply.command
    return {
        "age": time.monotonic() - seen.at,
        "client": request.client,
        "speed": _number(request.speed),
        "pose": None if request.pose is None else [_number(v) for v in request.pose],
        "status": reply.status,
        "reason": reply.reason,
        "kept": reply.kept,
        "candidates": len(reply.ranking),
        "refused": sum(not candidate.usable for candidate in reply.ranking),
        "command": None if command is None else msgspec.to_builtins(command),
        "planner": _number(reply.seconds.get("planner", math.nan)),
        "chosen": None if chosen is None else _driven(chosen),
        "others": [_other(plan) for plan in others],
    }


def _driven(plan: Plan) -> dict[str, Any]:
    count = plan.values.shape[1]
    kept = _spread(count, _MOST_STATIONS)
    names = [limit.name for limit in plan.limits]
    firsts = np.array([limit.first for limit in plan.limits])
    codes = np.searchsorted(firsts, kept, side="right") - 1
    return {
        "name": plan.candidate,
        "status": plan.status,
        "reason": plan.reason,
        "travel_time": _number(plan.travel_time),
        "progress": _number(plan.progress),
        "length": _number(float(plan.column("station")[-1])),
        "clear": _number(plan.clear_distance),
        "least_margin": None if plan.least_margin is None else _number(plan.least_margin),
        "least_rear_load": _number(plan.least_rear_load),
        "limiting": [names[code] for code in codes],
        "obstacle": _met(plan.obstacle),
        **{name: _numbers(plan.column(name)[kept]) for name in _COLUMNS},
    }


def _met(obstacle: ObstacleMessage | None) -> dict[str, Any] | None:
    if obstacle is None:
        return None
    return {"x": _number(obstacle.x), "y": _number(obstacle.y), "bound": obstacle.bound}


def _other(plan: Plan) -> dict[str, Any]:
    kept = _spread(plan.values.shape[1], _OTHER_POINTS)
    places = {name: _numbers(plan.column(name)[kept]) for name in ("x", "y")}
    return {
        "name": plan.candidate,
        "status": plan.status,
        "obstacle": _met(plan.obstacle),
        **places,
    }


def learned(board: Board) -> dict[str, Any]:
    """What changes now and then: parameters with their history, ground, stops, the finding."""
    ground = board.ground
    return {
        "changes": board.changes,
        "groups": [_group(seen) for seen in board.groups().values()],
        "ground": None
        if ground is None
        else {"name": ground.name, "probability": _number(ground.probability), "at": ground.at},
        "stops": [
            {
                "speed": _number(stop.speed),
                "grade": _number(stop.grade),
                "predicted": _number(stop.predicted),
                "actual": _number(stop.actual),
                "surface": stop.surface,
                "outcome": stop.outcome,
                "version": stop.version,
                "at": stop.at,
            }
            for stop in board.stops()
        ],
        "finding": None if board.finding is None else _found(board.finding),
    }


def _found(seen: FindingSeen) -> dict[str, Any]:
    offer, told = seen.offer, seen.offer.numbers()
    gap = told.stop_distance
    return {
        "state": seen.state,
        "words": seen.words,
        "purpose": seen.purpose,
        "command": seen.command,
        "id": offer.id,
        "verdict": offer.verdict,
        "summary": offer.summary,
        "effects": [
            {"name": effect.name, "parameters": msgspec.to_builtins(effect.parameters)}
            for effect in told.effects
        ],
        "before": gap.before,
        "after": gap.after,
        "floor": gap.noise_floor,
        "longer": [_number(offer.beside_file.least), _number(offer.beside_file.most)],
        "at": offer.at,
        "stops": offer.stops,
        "cause": offer.cause,
        "notes": offer.notes,
    }


def _group(seen: Sequence[GroupSeen]) -> dict[str, Any]:
    last = seen[-1]
    # By name: in the past a group may have had others.
    values = [dict(zip(one.names, one.value, strict=True)) for one in seen]
    stds = [dict(zip(one.names, one.std, strict=True)) for one in seen]
    return {
        "group": last.group,
        "names": list(last.names),
        "valid": last.valid,
        "version": last.version,
        "cause": last.cause,
        "at": [one.at for one in seen],
        "value": [[_known(row, name) for name in last.names] for row in values],
        "std": [[_known(row, name) for name in last.names] for row in stds],
    }


def _known(row: Mapping[str, float | None], name: str) -> float | None:
    value = row.get(name)
    return None if value is None else _number(value, 5)


def _spread(count: int, most: int) -> NDArray[np.int64]:
    """Indices from the first to the last, evenly, at most so many."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, most).round().astype(np.int64))


def _number(value: float, decimals: int = _DECIMALS) -> float | None:
    return round(float(value), decimals) if math.isfinite(value) else None


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [_number(value) for value in values.tolist()]
