"""Maps whose heights have an error: planned over, compared with maps without it."""
