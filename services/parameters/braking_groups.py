"""Parameters of braking: one group for the base, one for each surface that stops taught about."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import re
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping
from statistics import median

import msgspec
import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import NAMES, design
from slopewise.models.calibration.learned_force import LearnedForce, braking_in_use
from slopewise.models.calibration.online import OnlineBraking
from slopewise.models.calibration.published import PublishSettings
from slopewise.models.calibration.recursive import Acceptance, RecursiveSettings
from slopewise.models.errors import ParameterError
from slopewise.models.laws import braking
from slopewise.models.parameters import Braking, Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.stop_stream import StreamedStop
from slopewise.planner.ground.uncertainty import HOUR, Uncertainty
from slopewise.services.parameters.above_file import limited
from slopewise.services.parameters.group import Description, ParameterGroups, State
from slopewise.services.parameters.learnable import StopTaught
from slopewise.services.parameters.new_surfaces import makes_room, unheard_of
from slopewise.services.settings.learning_settings import Learning

BASE = "braking"
_DEAD_TIME = "dead_time"
_UNITS = ("s/m", "1", "s/m", "1", "s")
_SURFACE = re.compile(r"[A-Za-z0-9_-]{1,40}")
_MOST_WEAKER = 64
_MOST_TOLD = 5
_DEAD_TIMES = 5
_MOST_DEAD_TIME = 3.0
_MAX_COEFFICIENT = 100.0
"""No coefficient of any vehicle is anywhere near it [s/m, 1, s/m, 1]."""

_UNSAID = (0.02, 0.06, 0.01, 0.05)
"""How certain a model file is taken to be that says nothing of it, standard deviations."""


class BrakingGroups(ParameterGroups):
    """What stops teach, surface by surface."""

    def __init__(
        self, prior: Model, settings: Learning, on_the_map: Callable[[], Collection[str]] = tuple
    ) -> None:
        """Begin with the model file's coefficients; ``on_the_map``: surfaces that the map names."""
        self._on_the_map = on_the_map
        self._prior = prior.braking
        self._settings = settings
        self._uncertainty = Uncertainty()
        known = prior.braking
        if known.covariance is None:
            diagonal = np.diag(np.square(_UNSAID))
            known = dataclasses.replace(known, covariance=tuple(map(tuple, diagonal.tolist())))
        self.digest = _digest(prior.braking)
        self._online = OnlineBraking(
            known,
            recursive=RecursiveSettings(change=settings.change),
            # How far plans may go above the file is limited on the way out, by the file's force.
            publish=PublishSettings(rise=settings.rise, only_valid=True, most_share=math.inf),
        )
        self._taught: dict[str, float] = {}
        self._weaker: dict[tuple[str, str], int] = {}
        self._dead_times: deque[float] = deque(maxlen=_DEAD_TIMES)
        self._aged = time.monotonic()
        self._known: Braking | None = None
        self._all: dict[str, LearnedForce] | None = None
        self._on_surface: dict[str, Braking] = {}
        self._stronger: list[str] = []

    # ------------------------------------------------------------------ learning

    def take(
        self, stop: StreamedStop, surface: str, source: str, distance: float | None
    ) -> StopTaught:
        """Learn from one stop.

        Raises:
            ParameterError: too many surfaces.
        """
        self._begin(surface)
        predicted = self._distance(surface, stop.onset_speed, stop.grade)
        if distance is None:
            slowing = GRAVITY * (stop.force_ratio + math.sin(stop.grade))
            late = self._prior.dead_time if math.isnan(stop.dead_time) else stop.dead_time
            distance = stop.onset_speed * late + stop.onset_speed**2 / (2.0 * slowing)
        planned = self.expected(surface, stop.onset_speed, stop.grade)
        done = self._online.take(stop, surface)
        if done.outcome is Acceptance.GATED and stop.force_ratio < planned:
            self._insist(stop, surface, source, planned)
        else:
            self._weaker.pop((surface, source), None)
        if done.outcome in (Acceptance.ACCEPTED, Acceptance.CHANGED):
            self._taught[surface] = time.monotonic()
        if 0.0 <= stop.dead_time <= _MOST_DEAD_TIME:
            self._dead_times.append(stop.dead_time)
        self._changed()
        return StopTaught(
            time.monotonic(),
            source,
            surface,
            stop.onset_speed,
            stop.grade,
            predicted,
            distance,
            done.outcome.value,
        )

    def _insist(self, stop: StreamedStop, surface: str, source: str, planned: float) -> None:
        """Weak stops of one source in a row lower plans, whatever others report between them.

        Otherwise whoever confirms the plan after each of them would silence bad news.
        """
        count = self._weaker.pop((surface, source), 0) + 1
        self._weaker[surface, source] = count
        while len(self._weaker) > _MOST_WEAKER:
            self._weaker.pop(next(iter(self._weaker)))
        if count >= RecursiveSettings().weaker:
            below = self._online.coefficients(surface).copy()
            below[3] -= planned - stop.force_ratio
            self._online.doubt(surface, below)
            self._weaker.pop((surface, source))

    def _begin(self, surface: str) -> None:
        """A surface that nobody braked on begins with a share of the weakest known force."""
        if not surface or surface in self._prior.terrain or self._online.knows(surface):
            return
        self._make_place(surface)
        self._online.doubt(surface, self._unheard_of())
        self._changed()

    def _make_place(self, surface: str) -> None:
        named = {*self._prior.terrain, *self._on_the_map()}
        least = self._corners(), self._unheard_of()
        goes = makes_room(surface, named, self._learned(), self._taught, least)
        if goes:
            self._put(goes, None, 0.0)

    def _unheard_of(self) -> Floats:
        return unheard_of(self._prior, self._learned(), self._uncertainty.untrained_share)

    def expected(self, surface: str, speed: float, grade: float) -> float:
        """F_b/W that is planned with at a speed [m/s] and grade [rad]."""
        if surface and surface not in self._prior.terrain and not self._online.knows(surface):
            return float(design(np.array([speed]), np.array([grade]))[0] @ self._unheard_of())
        on = self._on(surface)
        return float((on.m_m * speed + on.b_m) * grade + on.m_b * speed + on.b_b)

    def _on(self, surface: str) -> Braking:
        """What is planned with on one surface; the others need not be looked at."""
        known = self._on_surface.get(surface)
        if known is None:
            one = self._online.learned_of(surface)
            used = braking_in_use(self._prior, {} if one is None else {surface: one})
            used, _ = limited(self._prior, used, self._settings.most_above_file)
            known = self._on_surface[surface] = used.on(surface) if surface else used
        return known

    def _learned(self) -> dict[str, LearnedForce]:
        """What each surface has taught; looked up until something changes."""
        if self._all is None:
            self._all = self._online.learned()
        return self._all

    def _changed(self) -> None:
        """What was looked up holds no longer."""
        self._known = self._all = None
        self._on_surface.clear()

    def flags(self) -> list[str]:
        """What people should know of the force that is planned with."""
        if not self._stronger:
            return []
        names = ", ".join(name or "base" for name in self._stronger[:_MOST_TOLD])
        return [f"plans with stronger brakes than the model file: {names}"]

    def ground_changed(self, surface: str, before: str) -> bool:
        """The robot comes onto another surface, by name or without; does the base change with it?

        The base stands for ground without a name: it must not promise more than the ground now is
        known to give.
        """
        learned = self._learned()
        one = learned.get(surface) if surface else None
        if one is not None and one.accepted > 0:
            below = np.array([getattr(self.in_use({}).on(surface), name) for name in NAMES])
        elif surface in self._prior.terrain:
            below = np.array([getattr(self._prior.on(surface), name) for name in NAMES])
        elif surface and before:
            below = self._unheard_of()
        elif "" in learned:
            below = np.array([getattr(self._prior, name) for name in NAMES])
        else:
            return False
        had = learned.get("")
        corners = self._corners()
        force = corners @ np.array([getattr(self.in_use({}), name) for name in NAMES])
        if had is None and np.all(force <= corners @ below + 1e-9):
            return False
        self._online.doubt("", below)
        self._changed()
        return True

    def age(self) -> None:
        """Let what was learned grow older by the time since the last call."""
        now = time.monotonic()
        self._online.age(now - self._aged, self._settings.grows_old)
        self._changed()
        self._aged = now

    def ages(self, now: float) -> dict[str, float]:
        """Time since the last stop that each surface was taught by [s]."""
        oldest = self._settings.oldest
        return {name: min(now - self._taught.get(name, now), oldest) for name in self._learned()}

    def common_age(self, ages: Mapping[str, float]) -> float:
        """The age that everything has at least [s]; 0 while anything is as in the model file."""
        return min(ages.values()) if len(ages) == len(self.names()) else 0.0

    def in_use(self, ages: Mapping[str, float]) -> Braking:
        """The braking model to plan with; ages [s] widen the scatter of their surface.

        Without ages looked up until something changes: learning from one stop asks several times.
        """
        if ages:
            return self._late(self._limit(ages))
        if self._known is None:
            self._known = self._late(self._limit({}))
        return self._known

    def _late(self, used: Braking) -> Braking:
        """With brakes that answer no sooner than those of the last stops."""
        late = self.dead_time()
        tables = {
            name: table
            if table.dead_time is None
            else dataclasses.replace(table, dead_time=max(table.dead_time, late))
            for name, table in used.terrain.items()
        }
        return dataclasses.replace(used, dead_time=max(used.dead_time, late), terrain=tables)

    def _limit(self, ages: Mapping[str, float]) -> Braking:
        """What was learned, as far above the file as it may be."""
        drift = self._uncertainty.drift
        older = {name: drift * math.sqrt(age / HOUR) for name, age in ages.items()}
        used = braking_in_use(self._prior, self._learned(), older)
        used, self._stronger = limited(self._prior, used, self._settings.most_above_file)
        return used

    def dead_time(self) -> float:
        """Of the last stops the median [s]; brakes that answer sooner are given no credit."""
        late = median(self._dead_times) if len(self._dead_times) > 1 else 0.0
        return max(self._prior.dead_time, late)

    def distrust(self) -> set[str]:
        """Nowhere above the model file until stops make an estimate valid again; what changed."""
        changed = set()
        for surface, one in self._learned().items():
            if one.valid:
                age = self.ages(time.monotonic())[surface]
                self._put(surface, dataclasses.replace(one, valid=False), age)
                changed.add(_group_of(surface))
        return changed

    def lose(self) -> set[str]:
        """Forget all stops, as of brakes that may be worn; the groups that changed.

        Plans use the share of the file's force that they use on ground never braked on, with the
        scatter of the oldest age, until the next stops.
        """
        surfaces = [s for s in ("", *self._prior.terrain) if not self._online.knows(s)]
        for surface in surfaces:
            known = self._prior.on(surface) if surface else self._prior
            below = np.array([getattr(known, name) for name in NAMES])
            self._online.doubt(surface, self._uncertainty.untrained_share * below)
            self._taught[surface] = time.monotonic() - self._settings.oldest
        self._changed()
        return {_group_of(surface) for surface in surfaces}

    # ------------------------------------------------------------------ groups

    def names(self) -> list[str]:
        """Groups: the base, surfaces of the file, surfaces learned."""
        surfaces = dict.fromkeys((*self._prior.terrain, *self._learned()))
        return [BASE, *(f"{BASE}.{name}" for name in surfaces if name)]

    def owns(self, group: str) -> bool:
        """The base, and whatever may be the name of a surface."""
        surface = group.removeprefix(f"{BASE}.")
        if group == BASE or surface in self._prior.terrain:
            return True
        return surface != group and _SURFACE.fullmatch(surface) is not None

    def apply(self, model: Model) -> Model:
        """To plan with; what a surface is older than all is scatter of its own."""
        ages = self.ages(time.monotonic())
        common = self.common_age(ages)
        own = {name: age - common for name, age in ages.items()}
        return dataclasses.replace(model, braking=self.in_use(own))

    def describe(self, group: str) -> Description:
        """Values as planned with, before any margin."""
        surface = surface_of(group)
        one = self._learned().get(surface)
        used = self.in_use({}).on(surface) if surface else self.in_use({})
        matrix = used.covariance
        stds = (
            {}
            if matrix is None
            else {name: math.sqrt(max(matrix[i][i], 0.0)) for i, name in enumerate(NAMES)}
        )
        notes: dict[str, str | float] = {}
        if one is not None:
            notes = {"stops believed": one.accepted, "stops not believed": one.gated}
            notes |= {f"estimate {n}": v for n, v in zip(NAMES, one.estimate, strict=True)}
        return Description(
            values={name: getattr(used, name) for name in (*NAMES, _DEAD_TIME)},
            stds=stds,
            covariance=None if matrix is None else [list(row) for row in matrix],
            unit=dict(zip((*NAMES, _DEAD_TIME), _UNITS, strict=True)),
            valid=one is not None and one.valid,
            age=self.ages(time.monotonic()).get(surface, 0.0),
            notes=notes,
        )

    def state(self, group: str) -> State | None:
        """What a restart needs, None while nothing was learned."""
        surface = surface_of(group)
        one = self._learned().get(surface)
        dead_times = [] if surface else [*self._dead_times]
        if one is None and not dead_times:
            return None
        learned = None if one is None else msgspec.to_builtins(one)
        return {"learned": learned, "prior": self.digest, "dead_times": dead_times}

    def restore(self, group: str, state: State | None, age: float) -> None:
        """As it was ``age`` seconds ago.

        Raises:
            ValueError, KeyError: nothing that can have been learned.
        """
        surface = surface_of(group)
        learned = None if state is None else state["learned"]
        dead_times = [] if state is None else msgspec.convert(state["dead_times"], list[float])
        if not all(0.0 <= t <= _MOST_DEAD_TIME for t in dead_times):
            raise ParameterError(_DEAD_TIME, f"0 … {_MOST_DEAD_TIME:g} s")
        one = None if learned is None else msgspec.convert(learned, LearnedForce)
        self._put(surface, one, age)
        if not surface:
            self._dead_times = deque(dead_times, maxlen=_DEAD_TIMES)
        if one is not None and state is not None and state["prior"] != self.digest:
            self._online.doubt(surface)
        self._changed()

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """An operator's coefficients; above the model file's they count once stops confirm them.

        Raises:
            ParameterError: names the value, and what was expected.
        """
        surface = surface_of(group)
        now = self.describe(group).values
        for name in values:
            if name not in now or (surface and name == _DEAD_TIME):
                raise ParameterError(name, f"one of {', '.join(NAMES)}")
            if name != _DEAD_TIME and not abs(values[name]) <= _MAX_COEFFICIENT:
                limit = f"{_MAX_COEFFICIENT:g} {_UNITS[NAMES.index(name)]}"
                raise ParameterError(name, f"a number of -{limit} … {limit}, got {values[name]:g}")
        late = values.get(_DEAD_TIME)
        if late is not None and not self._prior.dead_time <= late <= _MOST_DEAD_TIME:
            words = f"{self._prior.dead_time:g} s of the model file … {_MOST_DEAD_TIME:g}"
            raise ParameterError(_DEAD_TIME, f"{words}, got {late:g}")
        if set(values) & set(NAMES):
            coefficients = tuple({**now, **values}[name] for name in NAMES)
            known = self._prior.on(surface) if surface else self._prior
            matrix = known.covariance or tuple(map(tuple, np.diag(np.square(_UNSAID)).tolist()))
            one = LearnedForce(coefficients, matrix, coefficients, False, 0, 0)
            self._put(surface, one, 0.0)
        if late is not None:
            self._dead_times = deque([late] * _DEAD_TIMES, maxlen=_DEAD_TIMES)
            self._changed()

    def _put(self, surface: str, one: LearnedForce | None, age: float) -> None:
        self._changed()
        if one is None:
            self._online.forget(surface)
            self._taught.pop(surface, None)
            return
        if surface and surface not in self._learned():
            self._make_place(surface)
        self._check(one, surface)
        self._online.restore(one, surface, age=age, time_constant=self._settings.grows_old)
        self._changed()
        self._taught[surface] = time.monotonic() - age

    def _check(self, one: LearnedForce, surface: str) -> None:
        """Raise unless the brakes slow the vehicle everywhere in the trained rectangle."""
        bounds = PublishSettings()
        forces = self._corners(surface) @ np.array(one.published)
        if not np.all((forces >= bounds.least - 1e-6) & (forces <= bounds.most + 1e-6)):
            words = f"F_b/W of {bounds.least} … {bounds.most} at trained speeds and grades"
            got = f"{forces.min():.3f} … {forces.max():.3f}"
            raise ParameterError(", ".join(NAMES), f"{words}, got {got}")
        m_m, b_m, m_b, b_b = one.published
        dataclasses.replace(self._prior, m_m=m_m, b_m=b_m, m_b=m_b, b_b=b_b)

    def _corners(self, surface: str = "") -> Floats:
        known = self._prior.on(surface) if surface else self._prior
        speed, grade = np.meshgrid(known.speed_range, known.grade_range)
        return design(speed.ravel(), grade.ravel())

    def _distance(self, surface: str, speed: float, grade: float) -> float:
        used, late = self._on(surface), self.dead_time()
        force = (used.m_m * speed + used.b_m) * grade + used.m_b * speed + used.b_b
        slowing = braking.deceleration(force, grade)
        if not slowing > 0.0:
            return math.inf
        distance = braking.stopping_distance(
            speed, slowing, max(used.dead_time, late), used.distance_offset
        )
        return float(distance)


def surface_of(group: str) -> str:
    """The surface that a group of braking is of; empty for the base."""
    return group[len(BASE) + 1 :]


def _group_of(surface: str) -> str:
    return f"{BASE}.{surface}" if surface else BASE


def _digest(known: Braking) -> str:
    """What tells one model file's braking from another's."""
    return hashlib.sha256(repr(known).encode()).hexdigest()[:16]
