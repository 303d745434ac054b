"""Conversion of ROS 2 messages from and to the types of planning."""

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
"""Levels of diagnostic_msgs/DiagnosticStatus."""

UNIT_TOLERANCE = 0.1
"""Deviation of a quaternion's length from 1: rounding, not a value that was never filled in [1]."""

_NANO = 1_000_000_000  # Nanoseconds per second
_MIN_POINTS = 3  # Points of a candidate, whose curvature the planner needs [1]
_SAME_PLACE = 1e-6  # Distance up to which consecutive poses are one place [m]
_BEHIND = 2.0  # Part of a path behind the vehicle that is sent: more than a vehicle's length [m]
_NEAR = 0.5  # Distance beyond that of the nearest point up to which others are as near [m]

_MAX_HEADING_ERROR = 1.0
"""Angle between vehicle and path up to which the path leads where the vehicle heads [rad]."""


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
    """Motion from a nav_msgs/Odometry."""
    pose, header = message.pose.pose, message.header
    roll, pitch, yaw = angles_of(pose.orientation)
    numbers = (pose.position.x, pose.position.y, message.twist.twist.linear.x)
    if not np.isfinite((*numbers, roll, pitch)).all():
        raise ParameterError("pose, twist", "finite numbers")
    x, y, speed = (float(number) for number in numbers)
    return OdometrySample(header.frame_id, stamp_of(header), x, y, yaw, speed)


def angles_of(q: Any) -> tuple[float, float, float]:
    """Roll, pitch (nose down positive) and yaw of an orientation, z-y-x [rad]."""
    length = float(np.sqrt(q.x**2 + q.y**2 + q.z**2 + q.w**2))
    if not abs(length - 1.0) < UNIT_TOLERANCE:
        raise ParameterError("orientation", f"a quaternion of length 1, got {length:.3g}")
    x, y, z, w = (part / length for part in (q.x, q.y, q.z, q.w))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return float(roll), float(pitch), float(yaw)


def candidate_of(name: str, message: Any) -> Path:
    """Candidate from a nav_msgs/Path, without repeated places."""
    points = points_of(message)
    if not np.isfinite(points).all():
        raise ParameterError("poses", "finite coordinates [m]")
    if len(points) > 1:
        moves = np.hypot(*np.diff(points, axis=0).T) > _SAME_PLACE
        points = points[np.concatenate(([True], moves))]
    if len(points) < 2:
        raise ParameterError("poses", f"at least 2 places, got {len(points)}")
    if len(points) < _MIN_POINTS:
        points = np.stack([points[0], points.mean(axis=0), points[1]])
    return Path(name=name, points=points)


def ahead_of(path: Path, motion: OdometrySample, horizon: float) -> Path:
    """Part of a candidate from a little behind the vehicle to the horizon [m].

    Of a path that passes the same place again, the first part is used that leads where the vehicle
    heads. Paths of a whole field would cost time, or be too long for a request.
    """
    points = path.points
    steps = np.diff(points, axis=0)
    station = np.concatenate(([0.0], np.cumsum(np.hypot(*steps.T))))
    if station[-1] <= horizon:
        return path
    distance = np.hypot(points[:, 0] - motion.x, points[:, 1] - motion.y)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    error = np.abs(np.angle(np.exp(1j * (np.append(headings, headings[-1]) - motion.heading))))
    near = distance <= distance.min() + _NEAR
    along = near & (error <= _MAX_HEADING_ERROR)
    here = station[int(np.argmax(along if along.any() else near))]
    first = max(int(np.searchsorted(station, here - _BEHIND, "right")) - 1, 0)
    last = max(int(np.searchsorted(station, here + horizon, "left")), first + _MIN_POINTS - 1)
    first = max(min(first, len(points) - _MIN_POINTS), 0)
    return Path(name=path.name, points=points[first : last + 1])


def stamp_of(header: Any) -> int:
    """Stamp of a header [ns]."""
    return int(header.stamp.sec) * _NANO + int(header.stamp.nanosec)


def header(frame: str, stamp: int) -> Any:
    """Header; ``stamp`` in ns."""
    types = typestore().types
    time = types["builtin_interfaces/msg/Time"](sec=stamp // _NANO, nanosec=stamp % _NANO)
    return types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def speed_limit(advice: SpeedAdvice, stamp: int) -> Any:
    """nav2_msgs/SpeedLimit in m/s; never the 0.0 that would lift all limits."""
    limit = float(advice.limit)
    if not (np.isfinite(limit) and limit > 0.0):
        raise ParameterError("limit", f"a finite limit > 0 [m/s], got {limit}")
    return typestore().types[SPEED_LIMIT](header("", stamp), False, limit)


def profile(plan: Plan | None, at: PlanPosition | None, frame: str, stamp: int) -> Any:
    """Plan as a nav_msgs/Path: the stamp of each pose is the time at which the plan reaches it.

    Args:
        plan, at: plan and the vehicle's position on it; None gives an empty path.
        stamp: now [ns].
    """
    types = typestore().types
    poses = []
    if plan is not None and at is not None:
        x, y, z, time, speed, grade = map(plan.column, ("x", "y", "z", "time", "speed", "grade"))
        yaw = np.arctan2(np.gradient(y), np.gradient(x))
        driven = int(np.flatnonzero(speed > 0.0).max(initial=-1)) + 2
        for k in range(at.ahead, min(driven, len(x))):
            reached = stamp + round((float(time[k]) - at.time) * _NANO)
            turn = _quaternion(float(yaw[k]), -float(grade[k]))
            point = types["geometry_msgs/msg/Point"](float(x[k]), float(y[k]), float(z[k]))
            pose = types["geometry_msgs/msg/Pose"](point, turn)
            poses.append(types["geometry_msgs/msg/PoseStamped"](header(frame, reached), pose))
    return types[PATH](header(frame, stamp), poses)


def _quaternion(yaw: float, pitch: float) -> Any:
    cy, sy = np.cos(yaw / 2.0), np.sin(yaw / 2.0)
    cp, sp = np.cos(pitch / 2.0), np.sin(pitch / 2.0)
    parts = (-sy * sp, cy * sp, sy * cp, cy * cp)
    return typestore().types["geometry_msgs/msg/Quaternion"](*(float(part) for part in parts))


@dataclass(frozen=True, slots=True)
class Condition:
    """One status of diagnostics; ``level``: OK, WARN or ERROR."""

    name: str
    level: int
    message: str
    values: Sequence[tuple[str, str]]


def diagnostics(conditions: Sequence[Condition], hardware: str, stamp: int) -> Any:
    """diagnostic_msgs/DiagnosticArray."""
    types = typestore().types
    status, pair = (types[f"diagnostic_msgs/msg/{n}"] for n in ("DiagnosticStatus", "KeyValue"))
    statuses = [
        status(c.level, f"slopewise: {c.name}", c.message, hardware, [pair(*v) for v in c.values])
        for c in conditions
    ]
    return types[DIAGNOSTICS](header("", stamp), statuses)


def flag(value: bool) -> Any:
    """std_msgs/Bool."""
    return typestore().types[BOOL](value)
