"""The planner beside its peers."""
