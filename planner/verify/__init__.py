"""Verifier: every constraint of a finished plan, checked by separate laws."""
