"""The slow reference: simulation of a stop."""
