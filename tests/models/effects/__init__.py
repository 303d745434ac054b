"""Effects, one by one and as a registry."""
