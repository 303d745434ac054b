"""The service over zenoh."""
