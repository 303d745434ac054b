"""Checker of finished speed plans, of this planner or any other, independent of the planner.

Of a plan it takes positions and speeds; ground, forces and every emergency stop are derived again
from the map and the model file. Its own are: heights under the wheels, grade, roll, curvature and
stations; the braking force with surfaces, level and caps; the integration of stops in time; the
drive, heading of the body and steering, and what the body strikes. Loads, friction, bilinear
heights and the force on a slope are in :mod:`slopewise.services.physics`, which the guard uses too.

Shared with the planner are the reader of model files (:mod:`slopewise.models.parameters`,
:mod:`slopewise.models.vehicle`) with the reader of maps, the formula of each named effect
(:mod:`slopewise.models.effects.registry`), the numbers of the steering
(:mod:`slopewise.models.steering`), quantiles of tracking errors
(:mod:`slopewise.models.input_errors`) and the number of standard gravity. A mistake in one of
these is a mistake in both. An import contract keeps everything else out.
"""
