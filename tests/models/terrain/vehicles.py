from __future__ import annotations

from slopewise.models.terrain.estimator import DriveSample, TerrainEstimator
from slopewise.models.terrain.observation import GroundObservation
from slopewise.models.terrain.resistances import TerrainEstimate
from slopewise.models.terrain.settings import EstimatorSettings, FilterSettings
from slopewise.models.vehicle import Vehicle
from tests.models.terrain.plant import Body

HUSKY = Body()
QUIET = EstimatorSettings(filter=FilterSettings(yaw_rate_std=0.03))


def samples_of(log) -> list[DriveSample]:
    return list(map(DriveSample, *(log[n].tolist() for n in ("t", *DriveSample._fields[1:]))))


def vehicle_of(body: Body = HUSKY) -> Vehicle:
    return Vehicle(
        mass=body.mass,
        wheelbase=body.wheelbase,
        track_width=body.track_width,
        cg_x=0.5 * body.wheelbase,
        cg_z=body.cg_z,
        wheel_radius=body.wheel_radius,
        drive="skid_steer",
        max_wheel_speed=1.0,
        max_drive_force=200.0,
        max_drive_power=300.0,
        motor_torque_constant=body.torque_constant,
        gear_ratio=body.gear_ratio,
        idle_current=body.idle_current,
    )


def estimator_of(body: Body = HUSKY, settings: EstimatorSettings = QUIET) -> TerrainEstimator:
    return TerrainEstimator(
        vehicle_of(body),
        slip_track=1.1,
        motion_resistance=TerrainEstimate(0.1, 0.1),
        settings=settings,
    )


def observe(estimator: TerrainEstimator, log: dict) -> list[GroundObservation]:
    estimates = [estimator.update(sample) for sample in samples_of(log)]
    estimates.append(estimator.finish())
    return [observation for observation in estimates if observation is not None]
