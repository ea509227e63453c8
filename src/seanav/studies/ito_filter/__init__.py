"""Paper 1: nonlinear filtering of an AUV as an Itô process, moment equations by SymPy."""
