"""The zenoh service: keys, threads, status. What it answers is made in :mod:`plan_service`.

Zenoh's own threads only put things into bounded queues; all replies and decoding are done by
threads of this file.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import math
import sys
import threading
import time
from collections import Counter, deque
from pathlib import Path
from types import TracebackType
from typing import Any
from uuid import uuid4

import numpy as np
import zenoh

from models.errors import InputError
from planner.elevation_map import ElevationMap
from services import messages, systemd, wire
from services.admission import Admission, Question
from services.config import ServiceConfig, zenoh_config
from services.connect import words_of
from services.files.map_file import read_map
from services.files.model_file import find_model, read_model
from services.live.board import Board
from services.map_store import KnownGround, MapStore
from services.messages import MapUpdate, PlanReply, PlanRequest, Status
from services.messages import Path as CandidateMessage
from services.parameter_desk import ParameterDesk
from services.parameter_service import ParameterService
from services.parameters_in_use import ParametersInUse, slowed
from services.plan_service import PlanService
from services.wire import Format

_log = logging.getLogger("slopewise")

_MOST_MAPS = 16
"""Map updates that may wait; one more is lost, counted and flagged."""

_TURN = 0.001
_REMEMBERED = 1000
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
        self.maps = MapStore(read_map(Path(config.map)) if config.map else None)
        prior = read_model(find_model(config.model))
        self.plans = PlanService(config, ParametersInUse(prior))
        self.parameters = ParameterService(
            config, prior, self._map_names_surfaces, self.plans.learn
        )
        self.counters: Counter[str] = Counter()
        self.board = Board()
        self._admission = Admission(config.planning.queue)
        self._updates: deque[zenoh.Sample] = deque()
        self._news = threading.Condition()
        self._seconds: deque[float] = deque(maxlen=_REMEMBERED)
        self._stopped = threading.Event()
        self._threads: list[threading.Thread] = []
        self._working: dict[str, float] = {}
        self._begun = time.monotonic()
        self._instance = uuid4().hex
        self._flags: list[str] = []
        self._key = config.key("plan")
        self._warm_up()

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
        # The status tells of it, so it is there before anybody asks.
        self._desk = ParameterDesk(
            self._session, config, self.parameters, self.counters, self.board
        )
        self._page = self._open_page()
        work = [self._work] * config.planning.workers
        for n, loop in enumerate([*work, self._turn_away, self._take_maps, self._tell]):
            thread = threading.Thread(target=loop, name=f"{loop.__name__}-{n}", daemon=True)
            thread.start()
            self._threads.append(thread)
        self._declared = [
            self._session.declare_queryable(self._key, self._on_query, complete=True),
            self._session.declare_subscriber(config.key("map"), self._on_map),
            self._session.liveliness().declare_token(config.key(f"alive/{config.id}")),
            self._session.declare_subscriber(
                config.key("status"), self._on_status, allowed_origin=zenoh.Locality.REMOTE
            ),
        ]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        """Tell whoever waits that nothing will come, and leave."""
        self._stopped.set()
        if self._page is not None:
            self._page.close()
        for declared in self._declared:
            declared.undeclare()
        self._desk.close()
        for question in self._admission.close():
            self._say(question, messages.BUSY, "the service is stopping")
        with self._news:
            self._news.notify_all()
        for thread in self._threads:
            thread.join(_PATIENCE)
        self._session.close()

    def wait(self, seconds: float | None = None) -> None:
        """Until :meth:`stop`, or for so long."""
        self._stopped.wait(seconds)

    def stop(self) -> None:
        """Let :meth:`wait` return; may be called from anywhere."""
        self._stopped.set()

    def status(self) -> Status:
        """How the service is."""
        seconds = np.array(self._seconds or [0.0])
        ground = self.maps.ground
        return Status(
            service=self.config.id,
            uptime=time.monotonic() - self._begun,
            parameters=self.plans.parameters.message(),
            map_version=0 if ground is None else ground.version,
            map_age=None if ground is None else ground.age(),
            flags=[
                *self._flags, *self.plans.parameters.flags, *self._desk.flags(),
                *self.plans.flags(ground),
            ],
            degraded=self.parameters.degraded(),
            instance=self._instance,
            counters=dict(self.counters + self.parameters.told()),
            seconds={
                "median": float(np.median(seconds)), "p99": float(np.percentile(seconds, 99))
            },
        )  # fmt: skip

    # ------------------------------------------------------------------ zenoh's threads

    def _on_query(self, query: zenoh.Query) -> None:
        planning = self.config.planning
        try:
            deadline = float(query.parameters.get("deadline") or planning.deadline)
        except ValueError:
            deadline = planning.deadline
        if not deadline > 0.0 or math.isinf(deadline):
            deadline = planning.deadline
        deadline = min(deadline, planning.longest_deadline)
        self.counters["queries"] += 1
        early = min(planning.early, 0.5 * deadline)
        if not self._admission.offer(Question(query, deadline - early)):
            self.counters["queries_lost"] += 1

    def _on_map(self, sample: zenoh.Sample) -> None:
        with self._news:
            if len(self._updates) < _MOST_MAPS:
                self._updates.append(sample)
                self._news.notify()
                return
        self.counters["map_updates_lost"] += 1
        self.maps.lose()

    def _on_status(self, sample: zenoh.Sample) -> None:
        """Another service with this id tells of itself here, too; anything else is none of ours."""
        with contextlib.suppress(InputError):
            other = wire.decode(
                Status, sample.payload, str(sample.encoding), "status", _LARGEST_STATUS
            )
            if other.service == self.config.id and other.instance != self._instance:
                self._has_twin()

    # ------------------------------------------------------------------ own threads

    def _work(self) -> None:
        name = threading.current_thread().name
        while (question := self._admission.take()) is not None:
            self._working[name] = time.monotonic()
            try:
                self._answer(question)
            except Exception:  # noqa: BLE001 - logged and counted; the process has to live
                self.counters["faults"] += 1
                _log.exception("a question was not answered as it should be")
                if self._admission.claim(question):
                    self._say(question, messages.ERROR, "fault of the service")
            finally:
                self._working.pop(name, None)

    def _well(self) -> bool:
        """Whether every worker gets on: none is still at a question long since told busy."""
        latest = time.monotonic() - self.config.planning.longest_deadline - _PATIENCE
        return all(began > latest for began in [*self._working.values()])

    def _answer(self, question: Question) -> None:
        begun = time.monotonic()
        query, client = question.query, ""
        encoding = str(query.encoding or "")
        try:
            request = wire.decode(
                PlanRequest, query.payload or b"", encoding, self._key,
                self.config.sizes.request_bytes,
            )  # fmt: skip
            client = request.client
            decoded = time.monotonic()
            reply = self.plans.answer(request, self.maps.ground, self._key)
        except InputError as error:
            self.counters["refused"] += 1
            if self._admission.claim(question):
                self._say(question, messages.ERROR, str(error))
            return
        written = wire.format_of(encoding)
        reply.seconds.update(queued=begun - question.arrived, decode=decoded - begun)
        payload = wire.encode(reply, written)
        if not self._admission.claim(question):
            # It was told busy meanwhile, so it does not drive this.
            if client:
                self.plans.forget(client)
            return
        with query:
            query.reply(self._key, payload, encoding=wire.encoding_of(PlanReply, written))
        self._seconds.append(time.monotonic() - question.arrived)
        self.counters["answered"] += 1
        self.board.planned(request, reply)
        self.counters["candidates_refused"] += sum(not c.usable for c in reply.ranking)

    def _turn_away(self) -> None:
        while (late := self._admission.late()) is not None:
            for question in late:
                self.counters["busy"] += 1
                self._say(question, messages.BUSY, "too many questions to answer this one in time")

    def _say(self, question: Question, status: str, reason: str) -> None:
        """An answer without plans, to a question that was claimed."""
        written = wire.format_of(str(question.query.encoding or ""))
        reply = PlanReply(status=status, reason=reason, service=self.config.id)
        try:
            with question.query as query:
                query.reply(
                    self._key, wire.encode(reply, written),
                    encoding=wire.encoding_of(PlanReply, written),
                )  # fmt: skip
        except zenoh.ZError as error:
            self.counters["replies_lost"] += 1
            _log.warning("a reply could not be sent: %s", error)

    def _take_maps(self) -> None:
        key = self.config.key("map")
        while True:
            with self._news:
                while not self._updates and not self._stopped.is_set():
                    self._news.wait()
                if self._stopped.is_set():
                    return
                sample = self._updates.popleft()
            try:
                update = wire.decode(
                    MapUpdate, sample.payload, str(sample.encoding), key,
                    self.config.sizes.map_bytes,
                )  # fmt: skip
                taken = self.maps.take(update, key)
            except InputError as error:
                self.counters["map_updates_refused"] += 1
                _log.warning("%s", error)
                continue
            except Exception:  # noqa: BLE001 - logged and counted; the process has to live
                self.counters["faults"] += 1
                _log.exception("a map update was not taken up")
                continue
            self.counters["map_updates" if taken else "map_updates_ignored"] += 1

    def _tell(self) -> None:
        key = self.config.key("status")
        publisher = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP
        )
        encoding = wire.encoding_of(Status, Format.JSON)
        while not self._stopped.wait(self.config.status.period):
            publisher.put(wire.encode(self.status(), Format.JSON), encoding=encoding)
            self._watch_learning()
            if self._well():
                systemd.tell(systemd.ALIVE)

    # ------------------------------------------------------------------ beginning

    def _open_page(self) -> Any:
        """The live page, if it is wanted; planning goes on without it."""
        if not self.config.page.enabled:
            return None
        from services.live import server, site

        source = site.Source(status=self.status, ground=lambda: self.maps.ground, board=self.board)
        try:
            hosts = server.own_names(self.config.page.host)
            return server.PageServer(self.config.page, site.Site(source, hosts))
        except InputError as error:
            self._flags.append("the live page cannot be served")
            _log.warning("%s", error)
            return None

    def _look_for_twin(self) -> None:
        alive = self.config.key(f"alive/{self.config.id}")
        if any(reply.ok for reply in self._session.liveliness().get(alive, timeout=0.5)):
            self._has_twin()

    def _has_twin(self) -> None:
        if _TWIN not in self._flags:
            self._flags.append(_TWIN)
            _log.warning("another service is called %s", self.config.id)

    def _map_names_surfaces(self) -> bool:
        ground = self.maps.ground
        return ground is not None and any(ground.elevation_map.class_names)

    def _watch_learning(self) -> None:
        """Parameters that nobody looks after grow old unseen: plans are slower until then."""
        if time.monotonic() - self._desk.beat < _HANGS_AFTER:
            return
        words = "learning hangs"
        if f"degraded: {words}" not in self.plans.parameters.flags:
            speed = self.config.learning.degraded_speed
            self.plans.learn(slowed(self.plans.parameters, speed, words))

    def _warm_up(self) -> None:
        flat = ElevationMap(elevation=np.zeros((8, 40)), resolution=1.0, origin=(-4.0, -4.0))
        points = np.stack([np.linspace(0.0, 20.0, 50), np.zeros(50)], axis=1)
        paths = [CandidateMessage(name="warm-up", points=points)]
        ground = KnownGround(flat, 0, time.monotonic())
        for client, pose in (("", None), ("warm-up", (0.0, 0.0, 0.0))):
            request = PlanRequest(speed=0.0, paths=paths, client=client, pose=pose)
            reply = self.plans.answer(request, ground, "warm-up")
            wire.encode(reply, Format.MESSAGEPACK)


def serve(config: ServiceConfig, seconds: float | None = None) -> None:
    """Run until a signal asks to stop."""
    import signal

    service: Any = Service(config)
    # What was built up to now stays: the collector need not look at it again between questions.
    gc.collect()
    gc.freeze()
    # Planning waits no longer than that for whoever learns or draws meanwhile.
    sys.setswitchinterval(_TURN)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: service.stop())
    with service:
        listens = ", ".join(config.zenoh.listen) if config.zenoh.mode != "client" else "a router"
        print(f"slopewise: {config.key('plan')} answers at {listens}", flush=True)
        systemd.tell(systemd.READY)
        service.wait(seconds)
        systemd.tell(systemd.STOPPING)
