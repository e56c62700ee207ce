"""The source paper's tables and figures, redone."""
