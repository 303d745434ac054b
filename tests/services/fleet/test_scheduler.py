from __future__ import annotations

import os

import pytest
import threadpoolctl

from slopewise.services.fleet.scheduler import Workers, each_done


def doubled(number: int) -> int:
    """Twice any number except 3, which ends the process that works on it; of 4 its threads."""
    if number == 3:
        os._exit(1)
    return threads() if number == 4 else 2 * number


def threads() -> int:
    """That linear algebra shares its work among."""
    import scipy.linalg  # has a separate library

    del scipy
    pools = threadpoolctl.threadpool_info()
    return max(pool["num_threads"] for pool in pools if pool["user_api"] == "blas")


def test_a_task_that_workers_die_of_is_given_up_and_the_others_are_done() -> None:
    """Each of them on one thread of linear algebra."""
    import dask

    tasks = [(str(i), i) for i in range(6)]
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        done = list(each_done(doubled, tasks, Workers(1), lambda number: -number))
    assert sorted(done) == [-3, 0, 1, 2, 4, 10]


@pytest.mark.nightly  # the other end of the same task, in another cluster
def test_a_task_that_workers_die_of_without_a_substitute_ends_all() -> None:
    import dask
    from distributed import KilledWorker

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        pytest.raises(KilledWorker),
    ):
        list(each_done(doubled, [("3", 3)], Workers(1)))


def test_without_workers_tasks_are_done_in_their_order_on_one_thread() -> None:
    with threadpoolctl.threadpool_limits(limits=2):
        assert threads() == 2
        tasks = [("a", 2), ("b", 4), ("c", 1)]
        assert list(each_done(doubled, tasks, Workers(0))) == [4, 1, 2]
        assert threads() == 2
