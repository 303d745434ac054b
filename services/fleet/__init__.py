"""A fleet's worth of paths and logs, on several processes or machines."""
