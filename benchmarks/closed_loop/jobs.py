"""Many drives on two processes, each of them kept as soon as it is over."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from .kept import Kept

Progress = Callable[[str, int], Callable[[int], Any]]
"""Called with a name and a total, gives what advances the bar."""

_PROCESSES = 2

Work = Callable[[int], Any]

_work: Work | None = None
_kept: Kept | None = None


def do_all(
    work: Work, numbers: Iterable[int], progress: Progress, what: str, keep: Kept | None
) -> list[Any]:
    """Results of jobs by number, in their order.

    Processes inherit the work: models hold views that cannot be sent.

    Args:
        work: gives the result of a job. numbers: of the jobs.
        progress: see :data:`Progress`. what: its name there.
        keep: results found in it are taken from there, all others put into it; None for neither.
    """
    wanted = list(numbers)
    advance = progress(what, len(wanted))
    found = {n: keep.find(n) for n in wanted} if keep is not None else {}
    done = {n: result for n, result in found.items() if result is not None}
    advance(len(done))
    missing = [n for n in wanted if n not in done]
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(_PROCESSES, context, _prepare, (work, keep)) as pool:
        for number, result in zip(missing, pool.map(_do, missing), strict=True):
            done[number] = result
            advance(1)
    return [done[n] for n in wanted]


def _prepare(work: Work, keep: Kept | None) -> None:
    global _work, _kept
    _work, _kept = work, keep


def _do(number: int) -> Any:
    assert _work is not None
    result = _work(number)
    if _kept is not None:
        _kept.put(number, result)
    return result
