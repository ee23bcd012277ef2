"""The outer problem: sequences of collisions, their tree, verdicts, workers, journal."""
