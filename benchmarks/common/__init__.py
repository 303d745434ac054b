"""Shared by all benchmarks: scene, timing, campaigns that resume, tables."""
