"""The discrepancy workflow inside the service: stops are stored, examined, and effects proposed."""
