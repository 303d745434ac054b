"""Result folder of a discrepancy run: the findings as JSON, and the model with them."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from slopewise.models.discrepancy.findings import Findings, Gap
from slopewise.services.io.files import sha256_of, write_atomic
from slopewise.services.io.model_file import write_model

FINDINGS, MODEL, PAGE = "discrepancy.json", "model.toml", "report.html"  # in a result folder


def write_findings(findings: Findings, folder: Path) -> list[Path]:
    """Write discrepancy.json and model.toml, each all or nothing; returns both files."""
    folder.mkdir(parents=True, exist_ok=True)
    content = json.dumps(findings_as_json(findings), allow_nan=False, indent=2, ensure_ascii=False)
    write_atomic(folder / FINDINGS, (content + "\n").encode())
    write_model(findings.model, folder / MODEL)
    return [folder / FINDINGS, folder / MODEL]


def source_of(logs: Sequence[Path], parent: Path, day: str) -> str:
    """Text on the origin of an effect: day, logs and parent model, with digits of their SHA-256."""
    *digests, of_parent = (f"{path.name} {sha256_of(path)[:12]}" for path in (*logs, parent))
    return f"slopewise discrepancy {day}; {', '.join(digests)}; parent {of_parent}"


def findings_as_json(f: Findings) -> dict[str, Any]:
    return {
        "verdict": f.verdict.value,
        "summary": f.summary,
        "effects": [asdict(e) | {"alternatives": list(e.alternatives)} for e in f.effects],
        "explanations": [asdict(e) for e in f.explanations],
        "located": [
            {
                "axis": a.axis,
                "range": [a.low, a.high],
                "unit": a.unit,
                "share_of_gap": a.share_of_gap,
                "p_value": a.p_value,
            }
            for a in f.located
        ],
        "gap": _gap(f.gap),
        "stop_distance": _gap(f.stop_distance),
        "next_experiment": {
            "text": f.next_experiment.text,
            "stops": [
                {k: v for k, v in asdict(stop).items() if v is not None}
                for stop in f.next_experiment.stops
            ],
            "repeats": f.next_experiment.repeats,
        },
        "cost": asdict(f.cost),
        "changes": list(f.changes),
        "resolvable": dict(f.resolvable),
        "stops": f.stops,
        "notes": list(f.notes),
        "seconds": f.seconds,
    }


def _gap(gap: Gap) -> dict[str, Any]:
    values = asdict(gap)
    values["ci95"] = None if gap.ci95 is None else list(gap.ci95)
    return {
        k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()
    }
