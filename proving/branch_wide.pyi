"""The same as dmoc.proving.branch with large arrays: setup.py has their sizes."""

from dmoc.proving.branch import Branch as Branch

LIMITS: tuple[int, ...]
