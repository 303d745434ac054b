"""Speed and optimality of the planner, compared with other tools and with lower bounds."""
