"""Drives behind the guard among obstacles, on separate kinematics and geometry."""
