"""Scene files: read, written, and told in words."""
