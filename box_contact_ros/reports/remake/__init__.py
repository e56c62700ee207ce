"""Every report at once, and the page that joins those of latency."""
