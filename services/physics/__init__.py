"""The second physics: what checker and guard both judge by, written apart from the planner's.

Heights of a map, the plane of the wheels, loads and friction, and the force of the brakes on a
slope, in numpy alone: a decision of the guard has milliseconds. How the two integrate stops, and
what they take for struck, stays their own.
"""
