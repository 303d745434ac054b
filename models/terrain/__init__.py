"""Properties of the ground, estimated while driving: Slip's parameters, two words, changes."""
