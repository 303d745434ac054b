"""Benchmarks of planner, calibration, discovery of missing effects, fleet and service."""
