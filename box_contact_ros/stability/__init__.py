"""Numerical stability: random poses judged by an independent test, and families of hard poses."""
