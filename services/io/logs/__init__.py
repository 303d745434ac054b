"""Drive logs in files: CSV, Parquet, recordings."""
