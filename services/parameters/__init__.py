"""Parameters in use: learned, set, stored, restored."""
