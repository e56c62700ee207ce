"""The Python face of the core: solvers, their results, their models and weights."""
