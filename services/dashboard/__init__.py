"""What people and monitors see of a running service: a live page, health and metrics over HTTP."""
