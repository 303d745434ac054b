"""Checks of a robot and of its files: configuration issues, with their fixes."""
