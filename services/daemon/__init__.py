"""The zenoh service as a process: what it is made of, how it begins and ends."""
