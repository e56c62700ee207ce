"""Programs that write docs/."""
