"""All groups of one vehicle's parameters, and what observations do to them.

Knows neither versions nor disk: what it says has changed, others keep.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Collection

from slopewise.models.calibration.published import PublishSettings
from slopewise.models.errors import ParameterError
from slopewise.models.laws import braking
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.stop_stream import StreamedStop
from slopewise.services.parameters.braking_groups import BASE, BrakingGroups
from slopewise.services.parameters.effects_group import EffectsGroup
from slopewise.services.parameters.ground_now import GroundNow, monitor_maker
from slopewise.services.parameters.group import DriveNews, ParameterGroups, State
from slopewise.services.parameters.intake import columns_of
from slopewise.services.parameters.learnable import StopTaught, may_add, unable
from slopewise.services.parameters.plausible_stops import MIN_DECELERATION, StopPace, contradiction
from slopewise.services.parameters.registry import GROUPS
from slopewise.services.parameters.stop_streams import StopStreams
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire.observations import (
    DriveSamples,
    RobotObservation,
    StopObservation,
    TerrainLabel,
)
from slopewise.services.wire.recent_warnings import RecentWarnings

_STRONGEST = PublishSettings().most
_MOST_STOPS = 200
NOT_LEARNED = "not learned from: "


class Learner:
    """Follows brakes and ground of one vehicle; one thread.

    Attributes:
        ground: what is driven on now. unable: why braking is not learned; empty if it is.
        effects: the finding that is offered, and the one in use.
        stops: the last ones, beside what was predicted. stop_count: all there were.
        implausible, contradictory, too_many: stops that were not learned from: no brakes make
            them, their numbers do not fit each other, there was no time for so many.
    """

    def __init__(
        self,
        prior: Model,
        settings: Learning,
        names_surfaces: Callable[[], bool] = bool,
        on_the_map: Callable[[], Collection[str]] = tuple,
    ) -> None:
        """Begin with a model file.

        Args:
            prior: its model.
            settings: of learning.
            names_surfaces: whether the map in use tells surfaces apart.
            on_the_map: names of the surfaces that it tells apart.
        """
        self._file = self._prior = prior
        self._settings, self._names_surfaces = settings, names_surfaces
        self._on_the_map = on_the_map
        self._braking = BrakingGroups(prior, settings, on_the_map)
        self._groups = [maker(prior, settings) for maker in GROUPS]
        self.effects = EffectsGroup(prior, self._take_up)
        self.ground = GroundNow(
            prior, monitor_maker(settings.terrains), settings.label_for, settings.sure
        )
        self.unable = self._unable(prior)
        self.stops: deque[StopTaught] = deque(maxlen=_MOST_STOPS)
        self.stop_count = self.implausible = self.contradictory = self.too_many = 0
        self._pace = StopPace(prior.vehicle, settings.stops_at_once)
        self._notices = RecentWarnings()
        self._streams = StopStreams(settings)
        self._last_surface = ""
        self._arrived = time.monotonic()

    # ------------------------------------------------------------------ observations

    def learn(
        self, one: RobotObservation, key: str, arrived: float | None = None
    ) -> tuple[set[str], str]:
        """Groups that changed, and what became of it.

        Args:
            one: as it was decoded. key: it came on, for errors.
            arrived: monotonic clock at its arrival, if that is not now [s].

        Raises:
            InputError, ParameterError: it cannot be used.
        """
        now = time.monotonic()
        self._arrived = now if arrived is None else arrived
        if not self._settings.enabled:
            return set(), self.unable
        if isinstance(one, TerrainLabel):
            self.ground.label(one, now)
            return self.on_surface(now), f"ground is {one.surface}"
        if isinstance(one, DriveSamples):
            return self._drive(one, key, now)
        assert isinstance(one, StopObservation)
        if words := contradiction(one):
            self.contradictory += 1
            self._notices.add(f"stops of {one.source} contradict themselves")
            return set(), NOT_LEARNED + words
        force = float(braking.force_ratio_of_deceleration(one.deceleration, one.grade))
        dead_time = math.nan if one.dead_time is None else one.dead_time
        stop = StreamedStop(
            now, one.speed, one.grade, force, one.deceleration_std / GRAVITY, dead_time
        )
        changed = self.on_surface(now)
        return self._stop(stop, one.surface or self.ground.surface(now), one, one.distance, changed)

    def _drive(self, one: DriveSamples, key: str, now: float) -> tuple[set[str], str]:
        columns = columns_of(one, key)
        ground = self.ground.drive(one.source, columns)
        samples = DriveNews(one.source, columns, ground)
        changed = {group for groups in self._all() for group in groups.drive(samples)}
        if ground.changed and self._braking.ground_changed("", self._last_surface):
            changed.add(BASE)
        changed |= self.on_surface(now)
        reason = "the ground changed" if ground.changed else "samples"
        surface = one.surface or self.ground.surface(now)
        for stop in self._streams.feed(one.source, columns, self._braking.dead_time()):
            changed, reason = self._stop(stop, surface, one, None, changed)
        return changed, reason

    def _stop(
        self,
        stop: StreamedStop,
        surface: str,
        one: RobotObservation,
        distance: float | None,
        changed: set[str],
    ) -> tuple[set[str], str]:
        if self.unable:
            return changed, self.unable
        # Wheels that lock stand at once, and a push downhill is no brake: neither tells of brakes.
        if not 0.0 < stop.force_ratio <= _STRONGEST:
            self.implausible += 1
            words = f"F_b/W above 0 and at most {_STRONGEST:g}, got {stop.force_ratio:.3g}"
            return changed, f"{NOT_LEARNED}expected {words}"
        slowing = GRAVITY * (stop.force_ratio + math.sin(stop.grade))
        if not slowing >= MIN_DECELERATION:
            self.implausible += 1
            words = f"a deceleration of at least {MIN_DECELERATION:g} m/s², got {slowing:.3g}"
            return changed, f"{NOT_LEARNED}expected {words}"
        takes = self._pace.takes(stop.onset_speed, max(slowing, 0.1), stop.dead_time)
        # Bad news is heard at any rate: it makes plans slower only.
        room = self._pace.room(takes, self._arrived)
        expected = 0.0 if room else self._braking.expected(surface, stop.onset_speed, stop.grade)
        if not room and stop.force_ratio >= expected:
            self.too_many += 1
            self._notices.add("more stops came than the vehicle can make")
            return changed, f"{NOT_LEARNED}more stops than the vehicle can make"
        done = self._braking.take(stop, surface, one.source, distance)
        self.stops.append(done)
        self.stop_count += 1
        changed = changed | {f"{BASE}.{surface}" if surface else BASE}
        # Where the map names no surfaces, the base stands for the ground there is.
        if surface and not self._names_surfaces():
            self._braking.take(stop, "", one.source, distance)
            changed.add(BASE)
        return changed, done.outcome

    def on_surface(self, now: float) -> set[str]:
        """Groups that change because the robot came onto other ground."""
        surface, before = self.ground.surface(now), self._last_surface
        if surface == before:
            return set()
        self._last_surface = surface
        if self.unable or not self._braking.ground_changed(surface, before):
            return set()
        return {BASE}

    # ------------------------------------------------------------------ groups

    def _all(self) -> list[ParameterGroups]:
        return [self._braking, *self._groups, self.effects]

    def names(self) -> list[str]:
        """All groups."""
        return [name for groups in self._all() for name in groups.names()]

    def group(self, name: str) -> ParameterGroups:
        """Who looks after a group, whether there is anything in it yet or not."""
        for groups in self._all():
            if groups.owns(name):
                return groups
        raise ParameterError("group", f"one of {', '.join(self.names())}, got {name[:80]}")

    def may_restore(self, name: str) -> bool:
        """Whether what was learned before of a group still has a say."""
        if any(groups.of_operators and groups.owns(name) for groups in self._all()):
            return True
        if not self._settings.enabled:
            return False
        if not (name.startswith(BASE) and bool(self.unable)):
            return True
        # What stops taught of the base is in an adopted finding already; of other ground it is not.
        adopted = self._prior is not self._file
        return adopted and name != BASE and not _counts_twice(self._prior)

    def distrust(self) -> set[str]:
        """Plan with the weaker of model file and what is known, until stops confirm it.

        Returns:
            Groups that changed.
        """
        changed = self._braking.distrust()
        return changed | {name for groups in self._groups for name in groups.distrust()}

    def lose(self) -> set[str]:
        """Forget all stops, see :meth:`BrakingGroups.lose`; the groups that changed."""
        return set() if self.unable else self._braking.lose()

    # ------------------------------------------------------------------ findings

    @property
    def base(self) -> Model:
        """What is learned on top of: the model file, or the finding that was adopted."""
        return self._prior

    def _unable(self, model: Model) -> str:
        if not self._settings.enabled:
            return "nothing is learned: it is off"
        return unable(model, "the model file" if model is self._file else "the adopted finding")

    def _take_up(self, model: Model | None, before: State | None) -> State | None:
        """Learn on top of a finding, or of the model file again.

        What stops taught counts below it from now on. Where braking cannot be learned on top of it,
        what they taught of the base is given back: the finding is made of the same stops.

        Raises:
            ParameterError: a surface's own force would be counted twice.
        """
        now, known = time.monotonic(), self._braking
        wanted = self._file if model is None else model
        learned = {name: known.state(name) for name in known.names()}
        learned = {name: state for name, state in learned.items() if state is not None}
        surfaces = sorted(set(learned) - {BASE})
        if surfaces and model is not None and _counts_twice(model):
            words = "no learned surfaces beside effects that add force, they"
            raise ParameterError("effects", f"{words} would count twice: {', '.join(surfaces)}")
        learns = self._unable(wanted) == ""
        given = None if model is None or learns else learned.pop(BASE, None)
        if before is not None and BASE not in learned and learns:
            learned[BASE] = before
        ages = known.ages(now)
        braking = BrakingGroups(wanted, self._settings, self._on_the_map)
        for name, state in learned.items():
            age = ages.get(name[len(BASE) + 1 :], self._settings.oldest)
            braking.restore(name, state, age)
        # Only what could be taken up whole is.
        self._prior, self._braking, self.unable = wanted, braking, self._unable(wanted)
        return given

    # ------------------------------------------------------------------ bringing out

    def flags(self) -> list[str]:
        """What people should know of what was learned, and of those who taught it."""
        return [*self._braking.flags(), *self._notices.active()]

    def age(self) -> None:
        """Let what was learned grow older by the time since the last call."""
        self._braking.age()

    def in_use(self) -> tuple[Model, float, float]:
        """The model to plan with, the age that all of it has, and the oldest of all [s]."""
        model = self._prior
        for groups in self._all():
            model = groups.apply(model)
        ages = self._braking.ages(time.monotonic())
        return model, self._braking.common_age(ages), max(ages.values(), default=0.0)


def _counts_twice(model: Model) -> bool:
    """Whether what stops teach holds force already that the model's effects add."""
    return bool(unable(model)) and any(may_add(effect) for effect in model.effect)
