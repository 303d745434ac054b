"""The discrepancy workflow inside the service: stops kept, looked at, found."""
