"""Parameters of the node: the keys of `slopewise ros --config`, with their defaults.

An empty text stands for an omitted key. `executable`, `start_patience` and `stop_patience`
belong to the node.
"""

from __future__ import annotations

NODE: dict[str, object] = {"executable": "slopewise", "start_patience": 30.0, "stop_patience": 5.0}

EDGE: dict[str, object] = {
    "ros.connect": ["tcp/127.0.0.1:7447"],
    "ros.config": "",
    "ros.domain": 0,
    "ros.distribution": "auto",
    "ros.namespace": "/",
    "ros.node": "slopewise",
    "ros.frame": "",
    "service.connect": "",
    "service.config": "",
    "service.namespace": "slopewise/robot",
    "service.timeout": 0.08,
    "topics.paths": ["plan"],
    "topics.map": "elevation_map",
    "topics.layer": "elevation",
    "topics.odometry": "odom",
    "topics.tf": "/tf",
    "topics.tf_static": "/tf_static",
    "topics.imu": "",
    "topics.joints": "",
    "topics.command": "",
    "topics.command_type": "TwistStamped",
    "topics.speed_limit": "speed_limit",
    "topics.profile": "speed_plan",
    "topics.diagnostics": "/diagnostics",
    "topics.stop": "speed_stop",
    "timing.period": 0.1,
    "timing.life": 0.5,
    "timing.path_age": 3.0,
    "timing.odometry_age": 0.3,
    "timing.clock": "unknown",
    "timing.max_latency": 0.2,
    "timing.transform_age": 1.0,
    "timing.horizon": 60.0,
    "timing.launch": 0.15,
    "timing.crawl": 0.01,
    "stop.deceleration": 1.5,
    "stop.dead_time": 0.5,
    "wheels.left": "",
    "wheels.right": "",
    "wheels.radius": 0.165,
}
