"""Readers of public recordings: each turns one of them into a drive log that every command reads.

They are examples of how to bring your own recording into the form of a drive log: units, signs
and clocks set right, and nothing repaired that the log should show unchanged.
"""
