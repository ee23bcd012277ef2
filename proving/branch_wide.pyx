# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False
"""The same as dmoc.proving.branch with large arrays: setup.py has their sizes."""
include "branch.pyx"
