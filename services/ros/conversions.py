"""Messages of ROS 2 from and to what planning knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.models.errors import ParameterError
from slopewise.services.io.bag_paths import points_of
from slopewise.services.io.bags import PATH, SPEED_LIMIT, typestore
from slopewise.services.ros.speed_limit import PlanPosition, SpeedAdvice
from slopewise.services.wire.plan_messages import Path, Plan

ODOMETRY = "nav_msgs/msg/Odometry"
IMU = "sensor_msgs/msg/Imu"
JOINTS = "sensor_msgs/msg/JointState"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
BOOL = "std_msgs/msg/Bool"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
OK, WARN, ERROR = 0, 1, 2

_NANO = 1_000_000_000
_FEWEST = 3
_BEHIND = 2.0  # [m]
_NEAR = 0.5  # [m] farther than the nearest point by that is as near
_TURNED = 1.0  # [rad]


@dataclass(frozen=True, slots=True)
class OdometrySample:
    """Odometry: frame, stamp [ns], x, y [m], heading [rad], speed along it [m/s]."""

    frame: str
    stamp: int
    x: float
    y: float
    heading: float
    speed: float


def motion_of(message: Any) -> OdometrySample:
    """What a nav_msgs/Odometry says.

    Raises:
        ParameterError: a number is none, or the orientation is no rotation.
    """
    pose, header = message.pose.pose, message.header
    roll, pitch, yaw = angles_of(pose.orientation)
    numbers = (pose.position.x, pose.position.y, message.twist.twist.linear.x)
    if not np.isfinite((*numbers, roll, pitch)).all():
        raise ParameterError("pose, twist", "finite numbers")
    x, y, speed = (float(number) for number in numbers)
    return OdometrySample(header.frame_id, stamp_of(header), x, y, yaw, speed)


def angles_of(q: Any) -> tuple[float, float, float]:
    """Roll, pitch (nose down positive) and yaw of an orientation, z-y-x [rad].

    Raises:
        ParameterError: no rotation, such as one that nobody filled in.
    """
    length = float(np.sqrt(q.x**2 + q.y**2 + q.z**2 + q.w**2))
    if not 0.9 < length < 1.1:
        raise ParameterError("orientation", f"a quaternion of length 1, got {length:.3g}")
    x, y, z, w = (part / length for part in (q.x, q.y, q.z, q.w))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return float(roll), float(pitch), float(yaw)


def candidate_of(name: str, message: Any) -> Path:
    """A candidate out of a nav_msgs/Path; places that repeat are left out.

    Raises:
        ParameterError: fewer than two places, or a coordinate that is none.
    """
    points = points_of(message)
    if not np.isfinite(points).all():
        raise ParameterError("poses", "finite coordinates [m]")
    if len(points) > 1:
        moves = np.hypot(*np.diff(points, axis=0).T) > 1e-6
        points = points[np.concatenate(([True], moves))]
    if len(points) < 2:
        raise ParameterError("poses", f"at least 2 places, got {len(points)}")
    if len(points) < _FEWEST:
        points = np.stack([points[0], points.mean(axis=0), points[1]])
    return Path(name=name, points=points)


def ahead_of(path: Path, motion: OdometrySample, horizon: float) -> Path:
    """The part of a candidate that matters now: a little behind the vehicle, and so far ahead [m].

    A path may pass by the same place again; the first part counts that leads where the vehicle
    heads. Paths of a whole field would cost time, or be too long to be asked for.
    """
    points = path.points
    steps = np.diff(points, axis=0)
    way = np.concatenate(([0.0], np.cumsum(np.hypot(*steps.T))))
    if way[-1] <= horizon:
        return path
    away = np.hypot(points[:, 0] - motion.x, points[:, 1] - motion.y)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    turned = np.abs(np.angle(np.exp(1j * (np.append(headings, headings[-1]) - motion.heading))))
    near = away <= away.min() + _NEAR
    along = near & (turned <= _TURNED)
    here = way[int(np.argmax(along if along.any() else near))]
    first = max(int(np.searchsorted(way, here - _BEHIND, "right")) - 1, 0)
    last = max(int(np.searchsorted(way, here + horizon, "left")), first + _FEWEST - 1)
    cut = points[max(min(first, len(points) - _FEWEST), 0) : last + 1]
    return Path(name=path.name, points=cut)


def stamp_of(header: Any) -> int:
    """A header's stamp [ns]."""
    return int(header.stamp.sec) * _NANO + int(header.stamp.nanosec)


def header(frame: str, stamp: int) -> Any:
    """A header; ``stamp`` [ns]."""
    types = typestore().types
    time = types["builtin_interfaces/msg/Time"](sec=stamp // _NANO, nanosec=stamp % _NANO)
    return types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def speed_limit(told: SpeedAdvice, stamp: int) -> Any:
    """A nav2_msgs/SpeedLimit in m/s; never the 0.0 that would lift all limits."""
    limit = float(told.limit)
    if not (np.isfinite(limit) and limit > 0.0):
        raise ParameterError("limit", f"a finite limit > 0 [m/s], got {limit}")
    return typestore().types[SPEED_LIMIT](header("", stamp), False, limit)


def profile(plan: Plan | None, at: PlanPosition | None, frame: str, stamp: int) -> Any:
    """A plan as a nav_msgs/Path: each pose stamped with when the plan is there.

    Args:
        plan: None gives an empty path: nothing to drive along.
        at: the vehicle on it. frame: of the plan. stamp: now [ns].
    """
    types = typestore().types
    poses = []
    if plan is not None and at is not None:
        x, y, z, time, speed = (plan.column(n) for n in ("x", "y", "z", "time", "speed"))
        grade = plan.column("grade")
        yaw = np.arctan2(np.gradient(y), np.gradient(x))
        driven = int(np.flatnonzero(speed > 0.0).max(initial=-1)) + 2
        for k in range(at.ahead, min(driven, len(x))):
            then = stamp + round((float(time[k]) - at.time) * _NANO)
            turn = _quaternion(float(yaw[k]), -float(grade[k]))
            point = types["geometry_msgs/msg/Point"](float(x[k]), float(y[k]), float(z[k]))
            pose = types["geometry_msgs/msg/Pose"](point, turn)
            poses.append(types["geometry_msgs/msg/PoseStamped"](header(frame, then), pose))
    return types[PATH](header(frame, stamp), poses)


def _quaternion(yaw: float, pitch: float) -> Any:
    cy, sy = np.cos(yaw / 2.0), np.sin(yaw / 2.0)
    cp, sp = np.cos(pitch / 2.0), np.sin(pitch / 2.0)
    parts = (-sy * sp, cy * sp, sy * cp, cy * cp)
    return typestore().types["geometry_msgs/msg/Quaternion"](*(float(part) for part in parts))


@dataclass(frozen=True, slots=True)
class Condition:
    """One status of diagnostics: OK, WARN or ERROR, in words, with further facts."""

    name: str
    level: int
    message: str
    values: Sequence[tuple[str, str]]


def diagnostics(conditions: Sequence[Condition], hardware: str, stamp: int) -> Any:
    """A diagnostic_msgs/DiagnosticArray."""
    types = typestore().types
    statuses = [
        types["diagnostic_msgs/msg/DiagnosticStatus"](
            c.level,
            f"slopewise: {c.name}",
            c.message,
            hardware,
            [types["diagnostic_msgs/msg/KeyValue"](key, value) for key, value in c.values],
        )
        for c in conditions
    ]
    return types[DIAGNOSTICS](header("", stamp), statuses)


def flag(value: bool) -> Any:
    """A std_msgs/Bool."""
    return typestore().types[BOOL](value)
