"""How fast the planner is, beside others on the same problems."""
