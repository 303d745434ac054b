"""Plans in three dimensions, as MCAP for Foxglove."""
