"""Meanings of plan statuses, and colours of limiting bounds."""

from __future__ import annotations

from slopewise.planner.limiting import BOUNDS
from slopewise.planner.plan import Status

STATUS_MEANING: dict[Status, str] = {
    Status.OK: "reaches the end of its path",
    Status.BLOCKED: "a valid plan that stops before some station",
    Status.DEGRADED: "safe, but a fallback was used",
    Status.INFEASIBLE: "even full braking from the start is not enough",
}


def limit_colours() -> str:
    """CSS with a variable ``--label`` and a swatch for each bound.

    That many colours cannot all be distinguished: each bound is also named where it is used.
    """
    light = "".join(f"  --{code.label}: {bound.colour};\n" for code, bound in BOUNDS.items())
    dark = "".join(
        f"    --{code.label}: {bound.colour_on_dark};\n"
        for code, bound in BOUNDS.items()
        if bound.colour_on_dark
    )
    swatches = "".join(
        f'[data-limiting="{code.label}"] {{ background: var(--{code.label}); '
        f"fill: var(--{code.label}); }}\n"
        for code in BOUNDS
    )
    scheme = "@media screen and (prefers-color-scheme: dark)"
    return f":root {{\n{light}}}\n\n{scheme} {{\n  :root {{\n{dark}  }}\n}}\n\n{swatches}"
