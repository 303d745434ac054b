"""From a drive log to a table of stops."""
