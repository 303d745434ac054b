from __future__ import annotations

import os

import dask
import pytest
import threadpoolctl
from distributed import KilledWorker

from slopewise.services.fleet.scheduler import Workers, each_done


def doubled(number: int) -> int:
    """Twice any number except 3, which ends the process that works on it."""
    if number == 3:
        os._exit(1)
    return 2 * number


def threads(_: int) -> int:
    """That linear algebra shares its work among."""
    import scipy.linalg  # has a separate library

    del scipy
    pools = threadpoolctl.threadpool_info()
    return max(pool["num_threads"] for pool in pools if pool["user_api"] == "blas")


def test_linear_algebra_has_one_thread_here_and_there() -> None:
    with threadpoolctl.threadpool_limits(limits=2):
        assert threads(0) == 2
        assert list(each_done(threads, [("a", 0)], Workers(0))) == [1]
        assert list(each_done(threads, [("a", 0)], Workers(1))) == [1]
        assert threads(0) == 2


def test_a_task_that_workers_die_of_is_given_up_and_the_others_are_done() -> None:
    tasks = [(str(i), i) for i in range(6)]
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        done = list(each_done(doubled, tasks, Workers(1), lambda number: -number))
        assert sorted(done) == [-3, 0, 2, 4, 8, 10]
        with pytest.raises(KilledWorker):
            list(each_done(doubled, tasks[3:4], Workers(1)))


def test_without_workers_tasks_are_done_in_their_order() -> None:
    assert list(each_done(doubled, [("a", 2), ("b", 1)], Workers(0))) == [4, 2]
