"""The progress bar of a long job, on standard error, in a process that shows one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_is_shown = False


def show_progress(is_shown: bool) -> None:
    """Show the bars of this process from now on, or none, as by default."""
    global _is_shown
    _is_shown = is_shown


@contextmanager
def progress_bar(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """A bar on a terminal, nothing elsewhere; yields a function that advances it."""
    # Imported late: most processes never wait.
    from rich import progress as bar
    from rich.console import Console

    console = Console(stderr=True)
    columns = (
        bar.TextColumn("{task.description}"),
        bar.BarColumn(),
        bar.MofNCompleteColumn(),
        bar.TimeRemainingColumn(),
    )
    hidden = not (_is_shown and console.is_terminal)
    with bar.Progress(*columns, console=console, transient=True, disable=hidden) as progress:
        task = progress.add_task(what, total=total)
        yield lambda done: progress.advance(task, done)
