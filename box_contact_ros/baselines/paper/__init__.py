"""The networks of the source paper, in C++: see networks.hpp and symmetry.hpp."""
