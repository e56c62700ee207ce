"""Recordings of running nodes, as bags."""
