"""Experiments: which network to train at all."""
