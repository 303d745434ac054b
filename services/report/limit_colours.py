"""Style of what limits a plan: a colour for each bound, from the registry of bounds."""

from __future__ import annotations

from slopewise.planner.limiting import BOUNDS


def limit_colours() -> str:
    """CSS: a variable ``--label`` and a swatch for each bound.

    So many colours cannot all be told apart: each is also named where it is used.
    """
    light = "".join(
        f"  --{limiting.label}: {bound.colour};\n" for limiting, bound in BOUNDS.items()
    )
    dark = "".join(
        f"    --{code.label}: {bound.colour_on_dark};\n"
        for code, bound in BOUNDS.items()
        if bound.colour_on_dark
    )
    swatches = "".join(
        f'[data-limiting="{name}"] {{ background: var(--{name}); fill: var(--{name}); }}\n'
        for name in (code.label for code in BOUNDS)
    )
    scheme = "@media screen and (prefers-color-scheme: dark)"
    return f":root {{\n{light}}}\n\n{scheme} {{\n  :root {{\n{dark}  }}\n}}\n\n{swatches}"
