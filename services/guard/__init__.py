"""A guard between ``cmd_vel`` and the base: passes, limits or stops velocity commands.

Its physics is independent: no planner, no solver, its own stopping distances over the map; loads
and forces are those of :mod:`slopewise.services.physics`. Files, formulas of named effects
(:mod:`slopewise.models.effects.registry`), message types and keys are read as everywhere. One
process decides, a second one watches it, and vice versa.
"""
