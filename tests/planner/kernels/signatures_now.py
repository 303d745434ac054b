"""Print the signatures of all kernels that a service compiles, the longest to compile first.

`python -m tests.planner.kernels.signatures_now > planner/kernels/signatures.json` writes them
down, with a cache that is empty (`NUMBA_CACHE_DIR`) in the order of how long they take.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterable, Iterator
from typing import Any

from numba.core import event
from numba.core.dispatcher import Dispatcher

from slopewise.planner.kernels.ahead import described
from slopewise.planner.kernels.borrowing import Borrowing
from slopewise.services.daemon import warm_up_requests
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.settings.service_settings import ServiceConfig


class Seconds(event.Listener):
    """How long each kernel took that Python called, with all that it calls itself [s]."""

    def __init__(self) -> None:
        self.of: dict[str, float] = {}
        self._begun: list[float] = []

    def on_start(self, happened: Any) -> None:
        self._begun.append(time.process_time())

    def on_end(self, happened: Any) -> None:
        took = time.process_time() - self._begun.pop()
        if not self._begun:
            name = name_of(happened.data["dispatcher"])
            self.of[name] = self.of.get(name, 0.0) + took


def name_of(kernel: Dispatcher) -> str:
    return f"{kernel.py_func.__module__}:{kernel.py_func.__name__}"


def called_by_python() -> Iterator[Dispatcher]:
    for name, module in sorted(sys.modules.items()):
        if name.startswith("slopewise.planner."):
            for signatures_of in vars(module).values():
                if (
                    isinstance(signatures_of, Dispatcher)
                    and signatures_of.py_func.__module__ == name
                ):
                    yield signatures_of


def signatures_now() -> dict[str, list[Any]]:
    """Of a process that has planned nothing yet."""
    seconds = Seconds()
    event.register("numba:compile", seconds)
    parameters = ActiveParameters(read_model(find_model("atv")))
    warm_up_requests.run(PlanService(ServiceConfig(model="atv"), parameters))
    signatures_of = {
        name_of(kernel): _each_once(
            [described(kind) for kind in kinds] for kinds in kernel.overloads
        )
        for kernel in called_by_python()
        if not isinstance(kernel, Borrowing)
        and (name_of(kernel) in seconds.of or kernel.stats.cache_hits)
    }
    return dict(sorted(signatures_of.items(), key=lambda item: -seconds.of.get(item[0], 0.0)))


def _each_once(signatures: Iterable[list[Any]]) -> list[Any]:
    """Where a kernel calls another one, numba may keep two of them that read alike."""
    return [json.loads(row) for row in dict.fromkeys(map(json.dumps, signatures))]


if __name__ == "__main__":
    lines = (f"{json.dumps(name)}: {json.dumps(s)}" for name, s in signatures_now().items())
    print("{\n" + ",\n".join(lines) + "\n}")
