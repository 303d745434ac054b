"""Given paths of many kinds: what is planned, and how fast who follows them exactly may be."""
