"""The edge to ROS 2: over zenoh as rmw_zenoh speaks it, without ROS."""
