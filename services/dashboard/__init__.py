"""The live page, health and metrics of a running service over HTTP."""
