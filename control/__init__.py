"""Motions linearised along themselves: transition and saltation matrices, stability, gains."""
