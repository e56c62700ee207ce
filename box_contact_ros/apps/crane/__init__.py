"""The crane: its simulation, its landing, and its node."""
