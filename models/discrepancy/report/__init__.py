"""Findings in words and pictures, and what to drive next."""
