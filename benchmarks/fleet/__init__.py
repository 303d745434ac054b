"""Paths of a fleet over a large map."""
