"""Score a method of naming effects on logs of random vehicles: one JSON line for each log."""

from __future__ import annotations

import json
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from .blind_run import runs_of
from .random_vehicles import make, requests
from .world_logs import WorldLog

Answer = dict[str, Any]
"""``verdict``, ``names``, ``confidence``, ``axis`` of one log."""


def todays(log: WorldLog) -> Answer:
    """The answer of the workflow."""
    from slopewise.models.discrepancy.workflow import investigate
    from slopewise.services.io.model_file import model_from_dict

    finding = investigate(log.columns, runs_of(log.columns), model_from_dict(log.tables, "log"))
    return {
        "verdict": finding.verdict.value,
        "names": [effect.name for effect in finding.effects],
        "confidence": min((effect.confidence for effect in finding.effects), default=0.0),
        "axis": finding.located[0].axis if finding.located else "",
    }


def scored(log: WorldLog, answer: Answer) -> Answer:
    """The answer with whether it is right, and whether it has a false name."""
    named = frozenset(answer["names"]) if answer["verdict"] == "missing_effect" else frozenset()
    allowed = [frozenset(names) for names in log.truth]
    match log.kind:
        case "clean":
            right = answer["verdict"] == "none"
        case "drift":
            right = answer["verdict"] == "parameter_drift"
        case "outside" if not log.axes:
            right = not named
        case "outside":
            right = answer["verdict"] == "unknown" and answer["axis"] in log.axes
        case _:
            right = named in allowed
    wrong = bool(named) and not any(named <= names for names in allowed)
    request = {"family": log.family, "kind": log.kind, "label": log.label, "seed": log.seed}
    return request | answer | {"right": right, "wrong": wrong}


def run(
    method: Callable[[WorldLog], Answer],
    families: Iterable[str],
    rounds: Iterable[int],
    half: int,
    out: Path,
) -> None:
    """Make, ask and judge; logs already in the file are omitted."""
    known = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    done = {(k["family"], k["seed"]) for k in known}
    todo = [(f, *r) for n in rounds for f in families for r in requests(f, n, half)]
    with out.open("a") as file:
        for family, kind, label, names, seed in todo:
            if (family, seed) in done:
                continue
            log = make(family, kind, label, names, seed)
            begin = time.process_time()
            try:
                answer = method(log)
            except Exception:  # noqa: BLE001 a fault is an answer, too
                answer = {"verdict": "fault", "names": [], "confidence": 0.0, "axis": ""}
                answer["text"] = traceback.format_exc(limit=-3)
            answer["seconds"] = round(time.process_time() - begin, 2)
            file.write(json.dumps(scored(log, answer)) + "\n")
            file.flush()


def table(lines: Iterable[Answer]) -> str:
    """Right, false names and verdicts by family and kind."""
    rows: dict[tuple[str, str], list[Answer]] = {}
    for line in lines:
        rows.setdefault((line["family"], line["kind"]), []).append(line)
    text = []
    for (family, kind), answers in sorted(rows.items()):
        right, wrong = (sum(f[key] for f in answers) for key in ("right", "wrong"))
        verdicts = dict(Counter(f["verdict"] for f in answers))
        text.append(f"{family:8} {kind:8} right {right}/{len(answers)}  false {wrong}  {verdicts}")
    return "\n".join(text)


if __name__ == "__main__":
    path = Path(sys.argv[1])
    if len(sys.argv) > 2:
        run(todays, sys.argv[2].split(","), range(int(sys.argv[3]), int(sys.argv[4])), 0, path)
    print(table(json.loads(line) for line in path.read_text().splitlines()))
