"""Closed loop with a physics engine: learn a braking model from stops, then drive with it."""
