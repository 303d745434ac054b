from __future__ import annotations

import math

from slopewise.models.parameters import Braking, Limits, Model, Terrain
from slopewise.models.terrain.estimator import DriveSample, TerrainEstimator
from slopewise.models.terrain.observation import (
    UNKNOWN,
    Features,
    GroundObservation,
    TerrainEstimate,
)
from slopewise.models.terrain.phases import Phase
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


MODEL = Model(
    name="plant",
    vehicle=vehicle_of(),
    braking=Braking(
        m_m=0.0,
        b_m=-0.2,
        m_b=0.0,
        b_b=0.25,
        dead_time=0.4,
        speed_range=(0.2, 1.0),
        grade_range=(-0.26, 0.26),
    ),
    terrain=Terrain(motion_resistance=0.13, lateral_resistance=0.2, slip_track=1.15),
    limits=Limits(speed=1.0, accel=0.5, decel=0.8, jerk=2.0, lateral_accel=1.0, min_load=0.1),
)


def observation_of(
    f_r: float,
    mu_t: float = math.nan,
    b_s: float = math.nan,
    *,
    turning: float = math.nan,
    end: float = 0.0,
    error: float = 0.005,
    pitch: float = 0.0,
) -> GroundObservation:
    """A stretch at 0.3 m/s with these estimates, NaN where not measured, and relative errors."""

    def estimate(value: float) -> TerrainEstimate:
        return UNKNOWN if math.isnan(value) else TerrainEstimate(value, error * value)

    measured = Features(estimate(f_r), estimate(mu_t), estimate(b_s))
    return GroundObservation(
        begin=end - 1.0,
        end=end,
        phase=Phase.TURN if math.isnan(f_r) else Phase.STRAIGHT,
        samples=100,
        speed=0.3,
        speed_difference=0.0,
        yaw_rate=0.0,
        pitch=pitch,
        onset_current=1.0,
        measured=measured,
        turning=estimate(turning),
        known=measured,
    )
