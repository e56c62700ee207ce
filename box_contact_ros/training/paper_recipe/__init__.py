"""The recipe of the source paper: its data sets, its networks, their errors."""
