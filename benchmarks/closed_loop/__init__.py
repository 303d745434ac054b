"""The planner in the loop of a physics engine that knows none of its laws."""
