"""Stops in drive logs: found, graded and measured, for everything that learns from them."""
