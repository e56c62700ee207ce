"""Data sets, fitting and the program `train`. Drawing and folding samples needs no PyTorch."""
