"""Files, command line and reports around the planner."""
