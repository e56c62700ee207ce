"""Reports on hard poses: the families, and public reports replayed."""
