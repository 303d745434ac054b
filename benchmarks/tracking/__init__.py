"""Passes of vehicles that steer with their front wheels and follow their plans inexactly."""
