"""Load for running nodes, and what is measured under it."""
