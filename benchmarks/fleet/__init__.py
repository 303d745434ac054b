"""Many paths over a large map."""
