"""Obstacles around a vehicle's limits: what plans make of them, and what happens if driven."""
