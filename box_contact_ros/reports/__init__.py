"""Programs that write docs/results/."""
