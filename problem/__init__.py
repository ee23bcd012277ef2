"""The statement of an optimal control problem, read and checked."""
