"""Causes of a plan's speed, bound by bound."""
