"""From candidate paths to ranked, verified plans."""
