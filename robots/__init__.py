"""Robots from the files that describe them."""
