"""A state that is always late, by the same or by a varying age, costs no stop and no jump."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.horizon.answer import CycleAnswer, PlanarState, command_of
from slopewise.planner.horizon.horizon import Horizon
from slopewise.planner.plan import Status
from tests.world.driving import PATIENT, PERIOD
from tests.world.ground import arc, plane, straight
from tests.world.vehicles import Tables, model_of, tables_with

STEP = 0.02
"""Of the vehicle's own motion [s]."""


@dataclass
class Obedient:
    """A vehicle that reaches each command a period after it takes effect, along its only path."""

    path: CandidatePath
    ground: ElevationMap
    tables: Tables = field(default_factory=tables_with)
    lag: float = 0.0
    clear: float = np.inf

    def __post_init__(self) -> None:
        self.horizon = Horizon(model_of(self.tables), PATIENT)
        self.past, self.commands = [(0.0, 0.0)], [0.0] * round(self.lag / PERIOD)
        self.answers: list[CycleAnswer] = []

    def state(self, age: float) -> PlanarState:
        """State a time ago [s]; it stood before it was asked for the first time."""
        station, speed = self.past[max(len(self.past) - 1 - round(age / STEP), 0)]
        x, y = self.path.points.T
        arc = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
        k = min(int(np.searchsorted(arc, station, "right")) - 1, len(x) - 2)
        heading = float(np.arctan2(y[k + 1] - y[k], x[k + 1] - x[k]))
        place = float(np.interp(station, arc, x)), float(np.interp(station, arc, y))
        return PlanarState(x=place[0], y=place[1], heading=heading, speed=speed, age=age)

    def cycle(self, age: float) -> CycleAnswer:
        """Ask once, and drive for one period."""
        answer = self.horizon.step(self.state(age), [self.path], self.ground, clear=self.clear)
        self.answers.append(answer)
        self.commands.append(answer.command.speed)
        command = self.commands.pop(0)
        station, speed = self.past[-1]
        for later in np.arange(STEP, PERIOD + 0.5 * STEP, STEP):
            reached = speed + (command - speed) * later / PERIOD
            self.past.append((station + 0.5 * (speed + reached) * later, reached))
        return answer

    @property
    def speed(self) -> float:
        return self.past[-1][1]

    def drive(self, ages: list[float]) -> float:
        """Drive until it stands at the end; the time that this takes [s]."""
        for n in range(400):
            self.cycle(ages[n % len(ages)])
            if n > 20 and self.past[-1][1] == self.past[-40][1] == 0.0:
                return n * PERIOD
        raise AssertionError("it does not arrive")


TURN = arc(14.0, 0.12)
HILLY = plane(-0.08, y=(-16.0, 16.0))
VARYING = [0.2, 0.28, 0.16, 0.1, 0.3, 0.12, 0.22, 0.26]


@pytest.mark.parametrize(
    "ages",
    [
        pytest.param([0.1], id="0.1", marks=pytest.mark.nightly),
        pytest.param([0.5], id="0.5"),
        pytest.param(VARYING, id="vary"),
    ],
)
def test_lateness_costs_no_stop_and_no_jump(ages: list[float]) -> None:
    prompt, late = Obedient(TURN, HILLY), Obedient(TURN, HILLY)
    for age in ages * 5:
        late.horizon.step(late.state(age), [], HILLY)
    reference, took = prompt.drive([0.0]), late.drive(ages)
    assert not any(answer.command.stop for answer in late.answers)
    assert {answer.status for answer in late.answers} <= {Status.OK, Status.BLOCKED}
    limits = late.tables["limits"]
    accel = np.diff([speed for _, speed in late.past[:: round(PERIOD / STEP)]]) / PERIOD
    assert -limits["decel"] - 0.4 < accel.min()
    assert accel.max() < limits["accel"] + 0.4
    assert took < 1.25 * reference


def test_a_vehicle_whose_declared_latency_is_that_of_its_brakes_stops_as_planned() -> None:
    tables = {**tables_with(), "tracking": {"latency": 0.2}}
    vehicle = Obedient(straight(14.0), HILLY, tables, lag=0.2)
    vehicle.drive([0.0])
    assert not any(answer.command.stop for answer in vehicle.answers)


def test_a_vehicle_at_rest_is_not_commanded_a_speed_of_later_on() -> None:
    """Until its state shows that it drives, commands go one period further in each cycle."""
    vehicle = Obedient(straight(14.0), HILLY)
    limit = vehicle.tables["limits"]["accel"] * PERIOD
    speeds = [vehicle.cycle(0.5).command.speed for _ in range(4)]
    assert np.all(np.diff([0.0, *speeds]) > 0.0)
    assert np.max(np.diff([0.0, *speeds])) <= limit + 1e-6


def test_braking_for_what_is_seen_now_catches_up_with_the_age_of_the_state() -> None:
    """The plan brakes from where the vehicle was measured: its command is that of a while later."""
    vehicle = Obedient(straight(30.0), plane())
    for _ in range(40):
        vehicle.cycle(0.3)
    assert vehicle.speed > 2.0
    place = vehicle.state(0.3)
    vehicle.clear = place.x + 5.0
    answer = vehicle.cycle(0.3)
    assert answer.chosen is not None
    assert answer.chosen.clear_distance < 5.0
    if not answer.command.stop:
        plan = answer.chosen
        station = place.x - plan.x[0]
        begin = float(np.interp(station, plan.station, plan.time))
        later = float(np.interp(begin + 0.3 + PERIOD, plan.time, plan.speed))
        assert answer.command.speed <= later + 1e-2
    assert answer.command.speed < place.speed - 0.3


def test_stops_of_a_plan_survive_the_oldest_state_of_late() -> None:
    prompt, varying = Obedient(straight(14.0), plane()), Obedient(straight(14.0), plane())
    varying.cycle(0.5)
    for vehicle in (prompt, varying):
        vehicle.clear = 8.0
        vehicle.cycle(0.1)
    fast, careful = (float(v.answers[-1].chosen.speed.max()) for v in (prompt, varying))
    assert careful < fast - 0.05


@pytest.mark.parametrize("age", [1e30, 1e300])
def test_a_state_older_than_any_vehicle_is_answered_by_full_braking(age: float) -> None:
    state = PlanarState(x=0.0, y=0.0, heading=0.0, speed=1.0, age=age)
    answer = Horizon(model_of(tables_with())).step(state, [straight(20.0)], plane())
    assert answer.chosen.status is Status.INFEASIBLE
    assert answer.command.speed == 0.0


def test_a_command_is_the_slower_one_of_two_times() -> None:
    vehicle = Obedient(straight(14.0), plane())
    plan = vehicle.cycle(0.0).chosen
    assert plan is not None
    braking = 0.8 * plan.travel_time
    for now, late, slower in ((0.3, 1.0, 0.3), (braking, braking + 0.4, braking + 0.4)):
        assert command_of(plan, now, late, PERIOD) == command_of(plan, slower, slower, PERIOD)
    assert command_of(plan, 0.0, 99.0, PERIOD).speed == 0.0


@pytest.mark.parametrize(("age", "latency"), [(0.0, 0.0), (0.2, 0.0), (0.0, 0.2), (0.3, 0.3)])
def test_speed_that_earlier_commands_still_add_is_planned_for(age: float, latency: float) -> None:
    """A vehicle slower than commanded speeds up until a command of now arrives."""
    tables = {**tables_with(), "tracking": {"latency": latency}}
    vehicle = Obedient(straight(40.0), plane(), tables)
    for _ in range(15):
        vehicle.cycle(age)
    commanded, accel = vehicle.answers[-1].command.speed, tables["limits"]["accel"]
    measured = replace(vehicle.state(age), speed=commanded - 0.5)
    new = CandidatePath("new", vehicle.path.points)
    answer = vehicle.horizon.step(measured, [new], vehicle.ground)
    assert answer.chosen is not None
    expected = min(commanded, measured.speed + accel * (age + latency))
    assert answer.chosen.speed[0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("missing", [0.6, 0.9, 1.2])
def test_a_slow_vehicle_off_its_line_needs_no_full_braking(missing: float) -> None:
    """Its way to the line and its plan begin at the same speed."""
    tables = {**tables_with(), "tracking": {"latency": 0.4, "lookahead": 1.0}}
    vehicle = Obedient(straight(40.0), plane(), tables)
    for _ in range(30):
        vehicle.cycle(0.4)
    on_line, commanded = vehicle.state(0.4), vehicle.answers[-1].command.speed
    state = replace(on_line, y=0.05, heading=0.2, speed=commanded - missing)
    answer = vehicle.horizon.step(
        state, [CandidatePath("new", vehicle.path.points)], vehicle.ground
    )
    assert answer.chosen is not None
    assert answer.chosen.accel.min() >= -tables["limits"]["decel"] - 1e-6
