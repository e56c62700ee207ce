"""Data sets, fitting and the program `train`. Only `fit` and `train` need PyTorch."""
