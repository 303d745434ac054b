"""A guard between ``cmd_vel`` and the base: passes, slows or stops commands.

It stands alone: no planner, no numba, its own reader of model files and its own stopping distances
over the map. Shared with the rest are the formula of each named effect
(:mod:`slopewise.models.effects.registry`), the words on the wire (:mod:`slopewise.services.wire`)
and the keys of ROS 2 (:mod:`slopewise.services.ros.naming`). A process of its own watches the one
that decides, and the other way around.
"""
