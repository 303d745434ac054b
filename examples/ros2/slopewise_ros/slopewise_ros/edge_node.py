"""A lifecycle node around `slopewise ros`.

configure reads parameters and writes the settings file, activate starts the edge and waits until
it is connected, deactivate lets it send its last stop and ends it, cleanup and shutdown remove what
is left. If the edge ends unasked while the node is active, the node deactivates itself; the
`twist_mux` lock of docs/nav2.md stops the robot then, because no limits arrive any more.
"""

from __future__ import annotations

import contextlib

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from slopewise_ros.parameters import EDGE, NODE
from slopewise_ros.process import Edge, EdgeError

_CHECK_INTERVAL = 0.5  # [s]


class EdgeNode(LifecycleNode):
    """Starts and stops the edge as its lifecycle says."""

    def __init__(self) -> None:
        """Declare all parameters with their defaults."""
        super().__init__("slopewise_edge")
        for name, default in {**NODE, **EDGE}.items():
            self.declare_parameter(name, default)
        self._edge: Edge | None = None
        self._watch = None

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Write the settings file."""
        try:
            values = {name: self._value(name) for name in EDGE}
            self._edge = Edge(str(self._value("executable")), values, self.get_logger().warning)
        except EdgeError as error:
            return self._failed(error)
        self.get_logger().info(f"settings in {self._edge.settings}")
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the edge; active once it is connected."""
        assert self._edge is not None
        try:
            line = self._edge.start(float(self._value("start_patience")))
        except EdgeError as error:
            return self._failed(error)
        self.get_logger().info(line)
        self._watch = self.create_timer(_CHECK_INTERVAL, self._check_process)
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the edge, which says a last stop."""
        self._end_watch()
        if self._edge is not None and not self._edge.stop(float(self._value("stop_patience"))):
            self.get_logger().warning("the edge did not end in time, and was killed")
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Remove the settings file."""
        self.forget()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """From any state."""
        self.forget()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Leave nothing running."""
        self.forget()
        return TransitionCallbackReturn.SUCCESS

    def _check_process(self) -> None:
        if self._edge is not None and not self._edge.running():
            self.get_logger().error("the edge ended unexpectedly; no more speed limits")
            self._end_watch()
            self.trigger_deactivate()

    def forget(self) -> None:
        """End the edge if it runs, and remove its settings."""
        self._end_watch()
        edge, self._edge = self._edge, None
        if edge is not None:
            edge.stop(float(self._value("stop_patience")))
            edge.forget()

    def _end_watch(self) -> None:
        if self._watch is not None:
            self.destroy_timer(self._watch)
            self._watch = None

    def _value(self, name: str) -> object:
        return self.get_parameter(name).value

    def _failed(self, error: Exception) -> TransitionCallbackReturn:
        self.get_logger().error(str(error))
        return TransitionCallbackReturn.FAILURE


def main(args: list[str] | None = None) -> None:
    """Spin until ROS says stop; the edge ends with the node."""
    rclpy.init(args=args)
    node = EdgeNode()
    try:
        with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
            rclpy.spin(node)
    finally:
        node.forget()
        node.destroy_node()
        rclpy.try_shutdown()
