"""The zenoh service: its components, start, end and status.

Plan requests arrive at :mod:`slopewise.services.planning.plan_endpoint`, maps at
:mod:`slopewise.services.planning.map_endpoint`, parameter requests and observations at
:mod:`slopewise.services.parameters.parameter_endpoint`. Zenoh's own threads only put messages into
their bounded queues.
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
from typing import Any
from uuid import uuid4

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.daemon import allocator, systemd
from slopewise.services.daemon.log_rate_limit import RateLimitFilter
from slopewise.services.dashboard.live_state import LiveState
from slopewise.services.dashboard.parameter_state import ParameterFeed
from slopewise.services.io.files import read_text
from slopewise.services.io.map_file import read_map
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.active_parameters import ActiveParameters, with_max_speed
from slopewise.services.parameters.parameter_endpoint import ParameterEndpoint
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.planning.map_endpoint import MapEndpoint
from slopewise.services.planning.map_store import MapStore
from slopewise.services.planning.plan_endpoint import PlanEndpoint
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.settings.zenoh_session import zenoh_config
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.connect import error_text
from slopewise.services.wire.endpoint import STOP_TIMEOUT
from slopewise.services.wire.peer_status import PeerStatus, router_warnings
from slopewise.services.wire.plan_messages import ServiceStatus

_log = logging.getLogger("slopewise")

_SWITCH_INTERVAL = 0.001
"""Longest wait of planning for a thread that learns or draws [s]: well below a cycle."""

_MAX_STATUS_BYTES = 1_000_000  # largest status of another service that is decoded [bytes]

_LEARNING_TIMEOUT = 10.0
"""Time without a sign of the learning thread from which plans are slowed [s]."""

_DISCOVERY_TIMEOUT = 0.5  # time in which another service with this id answers at the start [s]


class Service:
    """A running service; a context manager."""

    def __init__(self, config: ServiceConfig) -> None:
        """Read model and map, and make the components; none runs yet."""
        self.config = config
        initial = read_map(Path(config.map)) if config.map else None
        prior = read_model(find_model(config.model))
        self.maps = MapStore(initial, Path(config.map).name, prior.vehicle.wheel_radius)
        self.plans = PlanService(config, ActiveParameters(prior))
        self.parameters = ParameterService(config, prior, self.plans.learn, self._surfaces_of_map)
        self.counters: Counter[str] = Counter()
        self.board = LiveState()
        self._peers = PeerStatus()
        self._plan_endpoint = PlanEndpoint(
            config, self.plans, self.maps, self.counters, self.board.set_plan
        )
        self._map_endpoint = MapEndpoint(config, self.maps, self.counters)
        self._stopped = threading.Event()
        self._reporter = threading.Thread(target=self._report, name="status", daemon=True)
        self._started = time.monotonic()
        self._instance = uuid4().hex
        self._warnings: list[str] = []
        self._running = contextlib.ExitStack()

    def __enter__(self) -> Service:
        """Open the session and start to answer; what was started is ended if that fails."""
        with contextlib.ExitStack() as started:
            try:
                self._start(started)
            except BaseException:
                self._stopped.set()
                raise
            self._running = started.pop_all()
        return self

    def _start(self, started: contextlib.ExitStack) -> None:
        """Start all components; ``started`` ends them in reverse order."""
        config = self.config
        try:
            largest = max(config.sizes.request_bytes, config.sizes.map_bytes)
            self._session = zenoh.open(zenoh_config(config.zenoh, largest))
        except zenoh.ZError as error:
            where = ", ".join(config.zenoh.listen)
            expected = f"expected free endpoints, {where}: {error_text(error)}"
            raise InputError("zenoh", "listen", expected) from None
        started.callback(self._session.close)
        self._check_duplicate_id()
        for text in router_warnings(self._session, config.zenoh.mode):
            self._warn(text)
        # The status reports it, so it exists before the first request.
        board = ParameterFeed(self.parameters, self.board, config)
        self._learning = ParameterEndpoint(
            self._session, config, self.parameters, self.counters, board
        )
        started.callback(self._learning.close)
        for component in (self._map_endpoint, self._plan_endpoint):
            component.open()
            started.callback(component.close)
        self._reporter.start()
        started.callback(self._reporter.join, STOP_TIMEOUT)
        declared = [
            *self._plan_endpoint.declare(self._session),
            self._map_endpoint.declare(self._session),
            self._peers.declare(self._session, config.namespace),
            self._session.liveliness().declare_token(config.key(f"alive/{config.id}")),
            self._session.declare_subscriber(
                config.key("status"), self._on_status, allowed_origin=zenoh.Locality.REMOTE
            ),
        ]
        for declaration in reversed(declared):
            started.callback(declaration.undeclare)
        page = self._open_page()
        if page is not None:
            started.callback(page.close)

    def __exit__(self, *_: object) -> None:
        """Reply to all waiting requests that no answer will come, and leave."""
        self._stopped.set()
        self._running.close()

    def wait(self, seconds: float | None = None) -> None:
        """Block until :meth:`stop`, or for a duration [s]."""
        self._stopped.wait(seconds)

    def stop(self) -> None:
        """Let :meth:`wait` return; may be called from any thread."""
        self._stopped.set()

    def status(self) -> ServiceStatus:
        snapshot = self.maps.snapshot
        return ServiceStatus(
            service=self.config.id,
            uptime=time.monotonic() - self._started,
            parameters=self.plans.parameters.message(),
            map_version=0 if snapshot is None else snapshot.version,
            map_age=None if snapshot is None else snapshot.age(),
            flags=[
                *self._warnings,
                *self.plans.parameters.flags,
                *self._learning.flags(),
                *self.plans.warnings(snapshot),
                *(self.maps.warnings.active() if snapshot is None else ()),
                *self._peers.warnings(),
            ],
            degraded=[*self.parameters.degraded(), *self.plans.degraded(snapshot)],
            instance=self._instance,
            counters=dict(self.counters + self.parameters.counters),
            seconds=self._plan_endpoint.seconds(),
        )

    # ------------------------------------------------------------------ zenoh's threads

    def _on_status(self, sample: zenoh.Sample) -> None:
        """Detect another service in this namespace by its status."""
        with contextlib.suppress(InputError):
            status = codec.decode(
                ServiceStatus, sample.payload, str(sample.encoding), "status", _MAX_STATUS_BYTES
            )
            if status.instance == self._instance:
                return
            if status.service == self.config.id:
                self._note_duplicate_id()
            else:
                self._warn_clients(
                    f'another service, "{status.service}", answers requests in this namespace'
                )

    # ------------------------------------------------------------------ own threads

    def _report(self) -> None:
        key = self.config.key("status")
        publisher = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP
        )
        while not self._stopped.wait(self.config.status.period):
            publisher.put(**codec.payload_of(self.status(), Format.JSON))
            self._watch_learning()
            if self._plan_endpoint.is_alive():
                systemd.notify_systemd(systemd.ALIVE)

    def _watch_learning(self) -> None:
        """Slow plans while the learning thread hangs: parameters would age unnoticed."""
        if time.monotonic() - self._learning.beat < _LEARNING_TIMEOUT:
            return
        reason = "learning hangs"
        if f"degraded: {reason}" not in self.plans.parameters.flags:
            speed = self.config.learning.degraded_speed
            self.plans.learn(with_max_speed(self.plans.parameters, speed, reason))

    # ------------------------------------------------------------------ start

    def _open_page(self) -> Any:
        """The live page, if it is enabled; planning continues without it."""
        if not self.config.page.enabled:
            return None
        from slopewise.services.dashboard import server, site

        source = site.Source(
            status=self.status, ground=lambda: self.maps.snapshot, board=self.board
        )
        try:
            hosts = server.allowed_hosts(self.config.page.host)
            token = self.config.page.token and read_text(Path(self.config.page.token)).strip()
            return server.PageServer(self.config.page, site.Site(source, hosts, token))
        except InputError as error:
            self._warn("the live page cannot be served", str(error))
            return None

    def _check_duplicate_id(self) -> None:
        alive = self.config.key(f"alive/{self.config.id}")
        replies = self._session.liveliness().get(alive, timeout=_DISCOVERY_TIMEOUT)
        if any(reply.ok for reply in replies):
            self._note_duplicate_id()

    def _note_duplicate_id(self) -> None:
        shown = f'duplicate service id "{self.config.id}" in this namespace'
        text = f"{shown}; give each service its own id and namespace"
        self._warn_clients("another service has this id", text)

    def _warn_clients(self, flag: str, text: str = "") -> None:
        """Warn in the replies as well: a client gets the plan of either service, or vehicle."""
        self._warn(flag, text)
        if flag not in self.plans.notices:
            self.plans.notices.append(flag)

    def _warn(self, flag: str, text: str = "") -> None:
        """Flag a warning in the status, and log it, once."""
        if flag not in self._warnings:
            self._warnings.append(flag)
            _log.warning("%s", text or flag)

    def _surfaces_of_map(self) -> tuple[str, ...]:
        snapshot = self.maps.snapshot
        return () if snapshot is None else snapshot.elevation_map.class_names


def serve(
    config: ServiceConfig, seconds: float | None, ready: Callable[[str, dict[str, object]], None]
) -> None:
    """Run until a signal, or for a duration [s]; ``ready`` is called once requests are answered."""
    import signal

    _log.addFilter(RateLimitFilter())
    allocator.limit_malloc_arenas()
    service = Service(config)
    # Objects created up to now stay: the collector need not check them again between requests.
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: service.stop())
    with service:
        listens = config.zenoh.listen if config.zenoh.mode != "client" else ("a router",)
        plan = config.key("plan")
        ready(f"{plan} answers at {', '.join(listens)}", {"plan": plan, "listens": [*listens]})
        systemd.notify_systemd(systemd.READY)
        service.wait(seconds)
        systemd.notify_systemd(systemd.STOPPING)
