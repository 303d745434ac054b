"""Repeated log records are counted; what a service plans before its first request."""

from __future__ import annotations

import logging
import time

from slopewise.services.daemon import warm_up_requests
from slopewise.services.daemon.log_rate_limit import RateLimitFilter
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import codec


def written(log: RateLimitFilter, line: int, text: str) -> str | None:
    record = logging.LogRecord("slopewise", logging.INFO, "file.py", line, "%s", (text,), None)
    return record.getMessage() if log.filter(record) else None


def test_repeated_records_are_counted_and_written_once() -> None:
    log = RateLimitFilter(interval=60.0)
    assert [written(log, 1, str(n)) for n in range(4)] == ["0", None, None, None]
    assert written(log, 2, "another") == "another"
    unlimited = RateLimitFilter(interval=0.0)
    assert [written(unlimited, 1, str(n)) for n in range(2)] == ["0", "1"]


def test_the_count_is_written_after_the_interval() -> None:
    log = RateLimitFilter(interval=0.02)
    assert written(log, 1, "first") == "first"
    assert [written(log, 1, "x") for _ in range(3)] == [None] * 3
    time.sleep(0.03)
    assert written(log, 1, "later") == "later (and 3 like it)"


def test_the_number_of_remembered_lines_is_bounded() -> None:
    log = RateLimitFilter()
    for line in range(1000):
        written(log, line, "x")
    assert len(log) <= 256


def test_replies_of_the_warm_up_can_be_encoded() -> None:
    plans = PlanService(ServiceConfig(model="atv"), ActiveParameters(read_model(find_model("atv"))))
    snapshots = {}
    for snapshot, request in warm_up_requests.requests():
        reply = plans.answer(request, snapshot, "warm-up")
        snapshots[id(snapshot)] = snapshot  # kept alive, so that no other one gets its id
        for written_as in codec.Format:
            assert codec.encode(reply, written_as)
    assert len(snapshots) == 6
