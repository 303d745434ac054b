"""Findings as text and pictures, and the next stops to drive."""
