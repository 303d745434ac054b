"""As much of rclpy and launch as the colcon package uses; nothing here speaks to ROS."""

from __future__ import annotations

import sys
from enum import Enum
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest


class Answer(Enum):
    SUCCESS = 0
    FAILURE = 1
    ERROR = 2


class Logger:
    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []

    def __getattr__(self, level: str) -> Any:
        return lambda line: self.lines.append((level, line))


class LifecycleNode:
    """States and transitions as https://design.ros2.org/articles/node_lifecycle.html has them."""

    def __init__(self, name: str) -> None:
        self.name, self.state = name, "unconfigured"
        self.values: dict[str, Any] = {}
        self.timers: list[Any] = []
        self.logger = Logger()

    def declare_parameter(self, name: str, default: Any) -> None:
        assert name not in self.values
        self.values[name] = default

    def get_parameter(self, name: str) -> SimpleNamespace:
        return SimpleNamespace(value=self.values[name])

    def get_logger(self) -> Logger:
        return self.logger

    def create_timer(self, period: float, callback: Any) -> Any:
        self.timers.append(callback)
        return callback

    def destroy_timer(self, timer: Any) -> None:
        self.timers.remove(timer)

    def on_activate(self, state: Any) -> Answer:
        return Answer.SUCCESS

    def on_deactivate(self, state: Any) -> Answer:
        return Answer.SUCCESS

    def _to(self, callback: Any, begin: str, end: str) -> Answer:
        assert self.state == begin, self.state
        answer = callback(None)
        self.state = end if answer is Answer.SUCCESS else begin
        return answer

    def trigger_configure(self) -> Answer:
        return self._to(self.on_configure, "unconfigured", "inactive")  # type: ignore[attr-defined]

    def trigger_activate(self) -> Answer:
        return self._to(self.on_activate, "inactive", "active")

    def trigger_deactivate(self) -> Answer:
        return self._to(self.on_deactivate, "active", "inactive")

    def trigger_cleanup(self) -> Answer:
        return self._to(self.on_cleanup, "inactive", "unconfigured")  # type: ignore[attr-defined]

    def trigger_shutdown(self) -> Answer:
        return self._to(self.on_shutdown, self.state, "finalized")  # type: ignore[attr-defined]


class FakeEntity:
    """Anything that a launch file makes: what it was, with what."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self.arguments, self.named = arguments, named


def rclpy(patch: pytest.MonkeyPatch) -> None:
    """Put the fake where the package imports it from."""
    lifecycle = {
        "LifecycleNode": LifecycleNode,
        "LifecycleState": object,
        "TransitionCallbackReturn": Answer,
    }
    _module(patch, "rclpy")
    _module(patch, "rclpy.lifecycle", **lifecycle)
    _module(patch, "rclpy.executors", ExternalShutdownException=type("Ended", (Exception,), {}))


def launch(patch: pytest.MonkeyPatch) -> None:
    """Likewise of launch, launch_ros and lifecycle_msgs."""
    names = {
        "launch": ("LaunchDescription",),
        "launch.actions": ("DeclareLaunchArgument", "EmitEvent", "RegisterEventHandler"),
        "launch.conditions": ("IfCondition",),
        "launch.events": ("matches_action",),
        "launch.substitutions": ("LaunchConfiguration", "PathJoinSubstitution"),
        "launch_ros": (),
        "launch_ros.actions": ("LifecycleNode",),
        "launch_ros.event_handlers": ("OnStateTransition",),
        "launch_ros.events": (),
        "launch_ros.events.lifecycle": ("ChangeState",),
        "launch_ros.substitutions": ("FindPackageShare",),
    }
    for module, kinds in names.items():
        _module(patch, module, **{kind: type(kind, (FakeEntity,), {}) for kind in kinds})
    transition = SimpleNamespace(TRANSITION_CONFIGURE=1, TRANSITION_ACTIVATE=3)
    _module(patch, "lifecycle_msgs")
    _module(patch, "lifecycle_msgs.msg", Transition=transition)


def _module(patch: pytest.MonkeyPatch, name: str, **attributes: Any) -> None:
    module = ModuleType(name)
    vars(module).update(attributes)
    patch.setitem(sys.modules, name, module)
