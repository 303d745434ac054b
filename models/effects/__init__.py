"""Named effects that the base braking model leaves out."""
