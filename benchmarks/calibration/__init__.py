"""Coverage of the margins of a calibration, and their cost."""
