"""Looks at a robot and says what does not fit: its parameter files, a recording, or live."""
