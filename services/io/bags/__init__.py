"""ROS 2 recordings: topics, messages, types."""
