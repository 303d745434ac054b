"""One likelihood of all traces: from a table of stops to weights of explanations."""
