"""Report pages: one HTML file each, which needs neither a network nor a server."""
