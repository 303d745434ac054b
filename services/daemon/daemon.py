"""The zenoh service: what it is made of, how it begins and ends, what it tells of itself.

Questions for plans come to :mod:`slopewise.services.planning.plan_endpoint`, maps to
:mod:`slopewise.services.planning.map_endpoint`, parameters and observations to
:mod:`slopewise.services.parameters.endpoint`. Zenoh's own threads only put things into their
bounded queues.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any
from uuid import uuid4

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.daemon import allocator, systemd, warm_up
from slopewise.services.daemon.quiet_log import NowAndThen
from slopewise.services.dashboard.board import Board
from slopewise.services.dashboard.parameter_board import ParameterBoard
from slopewise.services.io.access import read_text
from slopewise.services.io.maps.map_file import read_map
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.endpoint import ParameterEndpoint
from slopewise.services.parameters.in_use import ParametersInUse, slowed
from slopewise.services.parameters.service import ParameterService
from slopewise.services.planning.cold_start import compile_first
from slopewise.services.planning.map_endpoint import MapEndpoint
from slopewise.services.planning.map_store import MapStore
from slopewise.services.planning.plan_endpoint import PlanEndpoint
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.settings.zenoh_session import zenoh_config
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.connect import words_of
from slopewise.services.wire.messages import ServiceStatus
from slopewise.services.wire.neighbours import Neighbours, peer_flags

_log = logging.getLogger("slopewise")

_TURN = 0.001
_LARGEST_STATUS = 1_000_000
_HANGS_AFTER = 10.0
_TWIN = "another service has this id"
_PATIENCE = 2.0


class Service:
    """A running service; a context manager."""

    def __init__(self, config: ServiceConfig) -> None:
        """Read model and map, plan once so that the first question finds everything compiled.

        Raises:
            InputError: a file named in the settings cannot be used.
        """
        self.config = config
        self.maps = MapStore(
            read_map(Path(config.map)) if config.map else None, Path(config.map).name
        )
        prior = read_model(find_model(config.model))
        self.plans = PlanService(config, ParametersInUse(prior))
        self.parameters = ParameterService(
            config, prior, self._map_names_surfaces, self.plans.learn, self._surfaces_on_the_map
        )
        self.counters: Counter[str] = Counter()
        self.board = Board()
        self._neighbours = Neighbours()
        self._questions = PlanEndpoint(
            config, self.plans, self.maps, self.counters, self.board.planned
        )
        self._updates = MapEndpoint(config, self.maps, self.counters)
        self._stopped = threading.Event()
        self._teller = threading.Thread(target=self._tell, name="status", daemon=True)
        self._begun = time.monotonic()
        self._instance = uuid4().hex
        self._flags: list[str] = []
        warm_up.run(self.plans)

    def __enter__(self) -> Service:
        """Open the session and begin to answer."""
        config = self.config
        try:
            self._session = zenoh.open(zenoh_config(config.zenoh, config.sizes))
        except zenoh.ZError as error:
            where = ", ".join(config.zenoh.listen)
            raise InputError(
                "zenoh", "listen", f"expected free endpoints, {where}: {words_of(error)}"
            ) from None
        self._look_for_twin()
        self._warn(peer_flags(self._session, config.zenoh.mode))
        # The status tells of it, so it is there before anybody asks.
        self._learning = ParameterEndpoint(
            self._session,
            config,
            self.parameters,
            self.counters,
            ParameterBoard(self.parameters, self.board, config),
        )
        self._page = self._open_page()
        self._questions.open()
        self._updates.open()
        self._teller.start()
        self._declared = [
            self._questions.declare(self._session),
            self._updates.declare(self._session),
            self._neighbours.declare(self._session, config.namespace),
            self._session.liveliness().declare_token(config.key(f"alive/{config.id}")),
            self._session.declare_subscriber(
                config.key("status"), self._on_status, allowed_origin=zenoh.Locality.REMOTE
            ),
        ]
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Tell whoever waits that nothing will come, and leave."""
        self._stopped.set()
        if self._page is not None:
            self._page.close()
        for declared in self._declared:
            declared.undeclare()
        self._learning.close()
        self._questions.close()
        self._updates.close()
        self._teller.join(_PATIENCE)
        self._session.close()

    def wait(self, seconds: float | None = None) -> None:
        """Until :meth:`stop`, or for so long."""
        self._stopped.wait(seconds)

    def stop(self) -> None:
        """Let :meth:`wait` return; may be called from anywhere."""
        self._stopped.set()

    def status(self) -> ServiceStatus:
        """How the service is."""
        ground = self.maps.ground
        return ServiceStatus(
            service=self.config.id,
            uptime=time.monotonic() - self._begun,
            parameters=self.plans.parameters.message(),
            map_version=0 if ground is None else ground.version,
            map_age=None if ground is None else ground.age(),
            flags=[
                *self._flags,
                *self.plans.parameters.flags,
                *self._learning.flags(),
                *self.plans.flags(ground),
                *(self.maps.flags() if ground is None else ()),
                *self._neighbours.flags(),
            ],
            degraded=[*self.parameters.degraded(), *self.plans.degraded(ground)],
            instance=self._instance,
            counters=dict(self.counters + self.parameters.told()),
            seconds=self._questions.seconds(),
        )

    # ------------------------------------------------------------------ zenoh's threads

    def _on_status(self, sample: zenoh.Sample) -> None:
        """Another service with this id tells of itself here, too; anything else is none of ours."""
        with contextlib.suppress(InputError):
            other = codec.decode(
                ServiceStatus, sample.payload, str(sample.encoding), "status", _LARGEST_STATUS
            )
            if other.service == self.config.id and other.instance != self._instance:
                self._has_twin()

    # ------------------------------------------------------------------ own threads

    def _tell(self) -> None:
        key = self.config.key("status")
        publisher = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP
        )
        encoding = codec.encoding_of(ServiceStatus, Format.JSON)
        while not self._stopped.wait(self.config.status.period):
            publisher.put(codec.encode(self.status(), Format.JSON), encoding=encoding)
            self._watch_learning()
            if self._questions.well():
                systemd.tell(systemd.ALIVE)

    # ------------------------------------------------------------------ beginning

    def _open_page(self) -> Any:
        """The live page, if it is wanted; planning goes on without it."""
        if not self.config.page.enabled:
            return None
        from slopewise.services.dashboard import server, site

        source = site.Source(status=self.status, ground=lambda: self.maps.ground, board=self.board)
        try:
            hosts = server.own_names(self.config.page.host)
            token = self.config.page.token and read_text(Path(self.config.page.token)).strip()
            return server.PageServer(self.config.page, site.Site(source, hosts, token))
        except InputError as error:
            self._flags.append("the live page cannot be served")
            _log.warning("%s", error)
            return None

    def _look_for_twin(self) -> None:
        alive = self.config.key(f"alive/{self.config.id}")
        if any(reply.ok for reply in self._session.liveliness().get(alive, timeout=0.5)):
            self._has_twin()

    def _warn(self, words: list[str]) -> None:
        self._flags.extend(words)
        for line in words:
            _log.warning("%s", line)

    def _has_twin(self) -> None:
        if _TWIN not in self._flags:
            self._flags.append(_TWIN)
            _log.warning("another service is called %s", self.config.id)

    def _map_names_surfaces(self) -> bool:
        ground = self.maps.ground
        return ground is not None and any(ground.elevation_map.class_names)

    def _surfaces_on_the_map(self) -> tuple[str, ...]:
        ground = self.maps.ground
        return () if ground is None else ground.elevation_map.class_names

    def _watch_learning(self) -> None:
        """Parameters that nobody looks after grow old unseen: plans are slower until then."""
        if time.monotonic() - self._learning.beat < _HANGS_AFTER:
            return
        words = "learning hangs"
        if f"degraded: {words}" not in self.plans.parameters.flags:
            speed = self.config.learning.degraded_speed
            self.plans.learn(slowed(self.plans.parameters, speed, words))


def serve(
    config: ServiceConfig, seconds: float | None, ready: Callable[[str, dict[str, object]], None]
) -> None:
    """Run until a signal asks to stop, or for so long; once it answers, `ready` is told."""
    import signal

    _log.addFilter(NowAndThen())
    allocator.keep_compact()
    compile_first("nobody is answered until that is done (slopewise warm-up does it ahead)")
    service: Any = Service(config)
    # What was built up to now stays: the collector need not look at it again between questions.
    gc.collect()
    gc.freeze()
    # Planning waits no longer than that for whoever learns or draws meanwhile.
    sys.setswitchinterval(_TURN)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: service.stop())
    with service:
        listens = config.zenoh.listen if config.zenoh.mode != "client" else ("a router",)
        plan = config.key("plan")
        ready(f"{plan} answers at {', '.join(listens)}", {"plan": plan, "listens": [*listens]})
        systemd.tell(systemd.READY)
        service.wait(seconds)
        systemd.tell(systemd.STOPPING)
