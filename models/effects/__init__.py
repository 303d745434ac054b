"""Named effects that extend the base braking model."""
