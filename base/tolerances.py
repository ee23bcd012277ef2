"""Tolerances that several modules have in common, each with its reason."""

# Of a solve, where it is given none: the residual of optimality, relative to the cost, the largest
# violation of a constraint, relative to its size, and the limit of iterations.
OPTIMALITY, VIOLATION, ITERATIONS = 1e-6, 1e-10, 1000
