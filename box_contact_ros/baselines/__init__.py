"""What the models are compared with: the paper's networks."""
