"""Obstacles around a vehicle's limits: blocked or passed by plans."""
