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


TRANSITIONS = {
    "configure": ("unconfigured", "inactive"),
    "activate": ("inactive", "active"),
    "deactivate": ("active", "inactive"),
    "cleanup": ("inactive", "unconfigured"),
    "shutdown": ("", "finalized"),
}
"""State in which each begins, "" for any, and the next one."""


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

    def __getattr__(self, name: str) -> Any:
        """`trigger_X` calls `on_X` in the state where X begins, and enters the next one."""
        transition = name.removeprefix("trigger_")
        begin, end = TRANSITIONS[transition]

        def trigger() -> Answer:
            assert self.state == (begin or self.state), self.state
            answer: Answer = getattr(self, f"on_{transition}")(None)
            self.state = end if answer is Answer.SUCCESS else self.state
            return answer

        return trigger


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
