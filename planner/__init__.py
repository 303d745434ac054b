"""From an elevation map and candidate paths to verified speed plans."""
