"""Plan requests and maps of the service."""
