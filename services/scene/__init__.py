"""Plans in three dimensions, as files for the viewers of robotics: MCAP for Foxglove, rerun."""
