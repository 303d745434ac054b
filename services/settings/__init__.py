"""The service's settings: one TOML file, strict, every key with a range."""
