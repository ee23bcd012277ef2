"""Tolerances that several modules have in common, each with its reason.

What counts as zero is a share of a size that the model, the problem or the motion says: no number
with a unit is small by itself.  What a simulation through contacts takes for zero is in
:mod:`dmoc.simulation.tolerances`, what the check lets pass beside what it measures.
"""

# What rounding leaves of sums of computed numbers: some thousand times their last digit.
ROUNDING = 1e-12
# What differs by less is the same, and what moves less stands still: solvers and integrators are
# right to 1e-10, and a user's decimals to as much.
SAME = 1e-9
# Where forces balance, solvers leave 1e-10 of what they would do alone.
BALANCED = 1e-8
# Conditions say the same twice where less is left of a slope of length 1 beside the others: the
# smallest singular value of such slopes; that of their products is its square.
DEPENDENT = 3e-6
# What a solver, or a user who has rounded its numbers, leaves of a condition that is kept.
KEPT = 1e-6
# Costs that differ by less, relative to them, may be those of one minimum: solves that end at
# different points of its neighbourhood differ by as much.
SAME_COST = 1e-5
# A parameter or a mass is also multiplied by itself, and no larger than this.
LARGEST_PARAMETER = 1e100
# A divisor that may be zero is at least this.
TINY = 1e-300
# Of a solve, where it is given none: the residual of optimality, relative to the cost, the largest
# violation of a constraint, relative to its size, and the limit of iterations.
OPTIMALITY, VIOLATION, ITERATIONS = 1e-6, 1e-10, 1000
