"""Programs that print or draw what the project claims, from the shipped weights."""
