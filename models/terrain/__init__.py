"""What the ground is like, learned while driving: Slip's three parameters, classes, changes."""
