"""Subdivision surfaces: refinement of a mesh and its primvars in whole-array NumPy."""
