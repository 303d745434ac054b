"""Obstacles around a vehicle's limits: blocked or passed by plans, and driven in an engine."""
