"""The ROS 2 edge of slopewise as a lifecycle node."""
