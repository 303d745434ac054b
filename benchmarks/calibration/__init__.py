"""Do the margins of a calibration hold, and how much do they cost?"""
