"""Engines that are measured where they are installed; an extra brings the small ones."""
