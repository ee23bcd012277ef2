"""Motions as plain data: trajectory, scene, states at any time, tables for other programs."""
