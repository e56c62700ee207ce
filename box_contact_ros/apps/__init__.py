"""Clients of the node, and the demo."""
