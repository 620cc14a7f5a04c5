"""Kernels as machine code without numba and Python: the library of a wheel, and firmware."""
