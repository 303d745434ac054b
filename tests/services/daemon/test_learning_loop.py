"""A robot drives from ground to ground, in a separate process, with a separate plant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from slopewise.services.io.model_file import find_model, read_model, write_model
from tests.services.parameter_client import Robot, block, column, send_ground
from tests.services.robot_plant import ASPHALT, ICE, SAND, Surface, Vehicle
from tests.services.service_process import Running, running

ATV = read_model(find_model("atv"))
PRIOR = replace(
    ATV,
    vehicle=replace(ATV.vehicle, max_wheel_speed=8.0, max_drive_force=3500.0, max_drive_power=9e3),
    braking=replace(
        ATV.braking,
        **{"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "b_b": 0.14, "distance_offset": 0.1},
        speed_range=(0.5, 5.0),
        grade_range=(-0.2, 0.2),
        covariance=tuple(map(tuple, np.diag([1e-5, 1e-4, 1e-6, 1e-5]).tolist())),
        force_std=0.01,
    ),
    terrain=replace(ATV.terrain, motion_resistance=0.05, lateral_resistance=0.3, slip_track=1.2),
    limits=replace(ATV.limits, speed=5.0, accel=2.5, decel=4.0, jerk=20.0, min_load=0.05),
)
"""Of the worst ground."""

CLEAR = 9.0


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("loop")
    write_model(PRIOR, folder / "cautious.toml")
    # Legs take no time here.
    learning = (
        "[learning]\nmost_above_file = 5.0\nstops_at_once = 1000\nrise = 0.05\n"
        '[store]\npath = "p.sqlite"'
    )
    with running(folder, planning=learning, model="cautious.toml") as started:
        yield started


class Drive:
    """Legs from rest; in each the robot has to stop where that is hardest."""

    def __init__(self, robot: Robot, labelled: bool) -> None:
        self.robot, self.labelled = robot, labelled
        self.vehicle = Vehicle(seed=7)
        self.overruns = 0
        self.versions: list[int] = []

    def leg(self, name: str, surface: Surface) -> float:
        """Top speed of the plan; the stop happens in the plant, and is sent as samples."""
        robot = self.robot
        if self.labelled:
            robot.send("terrain", robot.fields(surface=name))
        reply = robot.plan(0.0, clear=CLEAR)
        self.versions.append(reply["parameters"]["version"])
        (plan,) = reply["plans"]
        station, speed = column(plan, "station"), column(plan, "speed")
        worst = 0.0
        for at, fast in zip(station, speed, strict=True):
            if fast > 0.6:
                clone = Vehicle(seed=int(self.vehicle.random.integers(1 << 31)))
                distance, _ = clone.stop(surface, float(fast))
                worst = max(worst, float(at) + distance)
        self.overruns += worst > CLEAR
        fastest = int(np.argmax(speed))
        _, samples = self.vehicle.stop(surface, float(speed[fastest]))
        fields = robot.fields(columns=list(samples), values=block(np.stack(list(samples.values()))))
        receipt = robot.send("drive", fields)
        assert receipt["status"] == "taken", receipt
        assert receipt["durable"]
        return float(speed.max())


def test_unnamed_ground_slows_plans_within_two_stops(service: Running) -> None:
    with service.session() as session:
        robot = Robot(service, session, "unnamed ground")
        send_ground(robot)
        drive = Drive(robot, labelled=False)
        asphalt = [drive.leg("", ASPHALT) for _ in range(24)]
        assert drive.overruns == 0
        assert robot.level_force() == pytest.approx(ASPHALT.force - 0.01, rel=0.06)
        for surface, legs in ((SAND, 12), (ICE, 8)):
            before = drive.overruns
            tops = [drive.leg("", surface) for _ in range(legs)]
            # Only stops show the change: two of them may go too far.
            assert drive.overruns - before <= 2
            assert max(tops[2:]) < asphalt[-1]
            assert robot.level_force() == pytest.approx(surface.force, rel=0.08)
        assert tops[2] < 0.75 * tops[0]
        assert robot.status()["parameters"]["version"] > 44


def test_named_ground_is_never_overrun_and_becomes_known(service: Running) -> None:
    with service.session() as session:
        robot = Robot(service, session, "named ground")
        assert robot.roll_back(1)["status"] == "ok"
        drive = Drive(robot, labelled=True)
        grounds = (("asphalt", ASPHALT, 24), ("sand", SAND, 20), ("ice", ICE, 14))
        tops = {
            name: [drive.leg(name, surface) for _ in range(legs)] for name, surface, legs in grounds
        }
        for name, surface, _ in grounds:
            truth = surface.force + surface.slope * 2.0
            assert robot.level_force(f"braking.{name}") == pytest.approx(truth, rel=0.06), name
            assert name == "ice" or robot.group(f"braking.{name}")["valid"], name
        assert drive.overruns == 0
        assert tops["asphalt"][-1] > 1.3 * tops["asphalt"][0], "what is learned makes it faster"
        assert tops["sand"][0] < tops["asphalt"][-1], "new ground begins slowly"
        assert tops["ice"][0] < 0.7 * tops["sand"][-1]
        assert tops["ice"][-1] < 0.75 * tops["sand"][-1]
        assert drive.versions == sorted(drive.versions)
        assert len(set(drive.versions)) > 50
        # Back on known ground without a name for it: plans stay slow until stops show it.
        assert drive.leg("asphalt", ASPHALT) < tops["asphalt"][-1]
        assert drive.overruns == 0
