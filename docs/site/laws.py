"""References of bounds and effects, made from the registries that planner and models use."""

from __future__ import annotations

from slopewise.models.effects.effect_law import Parameter
from slopewise.models.effects.registry import LAWS
from slopewise.planner.limiting import BOUNDS

_ENTERS = {
    "GROUND": "braking force, by place",
    "LASTING": "braking force, from a run on",
    "MOTION": "deceleration",
    "LAG": "build-up of the force",
    "FADE": "force of hot brakes",
    "CAP": "cap on the force",
    "CREST": "force over a crest",
}


def bounds_page() -> str:
    """Reference of all bounds on the speed at a station."""
    rows = [
        f"| {number.value} | `{number.label}` | {_upper(bound.meaning)} | `{bound.law}` |"
        for number, bound in BOUNDS.items()
    ]
    return "\n".join(
        [
            "# Bounds\n",
            "At each station the lowest of these bounds holds, and the plan names it: in the\n"
            "column `limiting` of `plan.csv`, on screens and in reports. Most of them take their\n"
            "numbers from the [model file](model.md#limits).\n",
            "| number | name | what it is | computed in |\n|--:|---|---|---|",
            *rows,
        ]
    )


def effects_page() -> str:
    """Reference of the effects that extend the base braking model."""
    rows = [
        f"| `{name}` | {_upper(law.missing)} | {_ENTERS[law.enters.name]} | "
        f"{'; '.join(_parameter(p, spec) for p, spec in law.parameters.items())} |"
        for name, law in LAWS.items()
    ]
    tests = [f"| `{name}` | {law.axis} | {_upper(law.experiment)} |" for name, law in LAWS.items()]
    return "\n".join(
        [
            "# Effects\n",
            "Additions to the base model (braking force linear in grade and onset speed, after a\n"
            "dead time). Each is an `[[effect]]` of the [model file](model.md#effect);\n"
            "several act together. `slopewise discrepancy` searches a drive log for them.\n",
            "| effect | missing in the base model | acts on | parameters |\n|---|---|---|---|",
            *rows,
            "\n## How to find them\n",
            "Along which axis stops differ from the model, and what to drive to see it best:\n",
            "| effect | axis | to drive |\n|---|---|---|",
            *tests,
        ]
    )


def _parameter(name: str, spec: Parameter) -> str:
    low, high = spec.bounds
    bounds = [f"≥ {low:g}"] if low > -1e300 else []
    bounds += [f"≤ {high:g}"] if high < 1e300 else []
    optional = "" if spec.default is None else f", optional ({spec.default:g})"
    return f"`{name}` {' and '.join(bounds)} \\[{spec.unit}]{optional}".replace("  ", " ")


def _upper(text: str) -> str:
    return (text[:1].upper() + text[1:]).replace("|", "&#124;").replace("<", "&lt;")
