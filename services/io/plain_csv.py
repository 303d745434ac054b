"""Long CSV files of the plainest kind, read by polars if it is installed.

Whatever could be read in two ways, such as quotes, lines of another length or a lone carriage
return, is left to the careful reader; so is a column with a cell that is no number. What is read
here is the same to the last bit, only sooner.
"""

from __future__ import annotations

import io
from collections.abc import Collection

from slopewise.models.arrays import Floats


def plain_columns(content: str, text: Collection[str]) -> dict[str, list[str] | Floats] | None:
    """Columns by name, None unless the content is plain and polars is there.

    Args:
        content: of the file.
        text: columns that stay text.
    """
    try:
        import polars
    except ImportError:
        return None
    content = content.replace("\r\n", "\n")
    head, _, body = content.partition("\n")
    names = [name.strip() for name in head.split(",")]
    if any(mark in content for mark in '"\r\0') or "" in names or len(set(names)) < len(names):
        return None
    try:
        frame = polars.read_csv(
            io.BytesIO(body.encode()),
            has_header=False,
            new_columns=names,
            infer_schema=False,
            quote_char=None,
        ).fill_null("")
    except polars.exceptions.PolarsError:
        return None
    lines = body.count("\n") + (not body.endswith("\n"))
    # Shorter lines are filled up by polars; the commas that they lack tell.
    whole = body.count(",") == lines * (len(names) - 1)
    if not (whole and frame.shape == (lines, len(names))):
        return None
    if not any((frame[name] != "").all() for name in names):  # perhaps lines of nothing
        return None
    columns: dict[str, list[str] | Floats] = {}
    for name in names:
        numbers = None if name in text else frame[name].cast(polars.Float64, strict=False)
        if numbers is None or numbers.null_count() or not numbers.is_finite().all():
            columns[name] = frame[name].to_list()
        else:
            columns[name] = numbers.to_numpy(writable=True)
    return columns
