# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False
"""Branch and bound over the durations of a problem that is linear between its events."""
from libc.math cimport INFINITY
from libc.stddef cimport size_t
from libc.string cimport memcpy

import numpy as np


cdef extern from "tree.h" nogil:
    enum: MOST_PHASES, MOST_INPUTS, MOST_STATE, MOST_MULTIPLIERS, MOST_PRICED, MOST_STEP_ROWS, MOST_THREADS
    enum: MOST_OPERATIONS, MOST_SHIFTS, MOST_GIVEN
    int PROVED, GOING_ON, NO_MEMORY
    ctypedef struct interval:
        double lo, hi
    ctypedef struct line:
        interval v0, d0, dd0, v, d, dd, ddd
    ctypedef struct Shifts:
        int operations, shifts
        const int *operation
        const double *constant
        const int *result
    void shifts_over(const Shifts *, interval, interval, line *)
    ctypedef struct Phase:
        int r, na, nb, steps, paths, nodes, given
        const double *place
        const double *drives
        const double *P
        const double *R
        const double *c
        double c_0
        const double *lower
        const double *upper
        const double *path
        const double *most
        const double *since
        const double *moves
        const double *within
        int rows, conditions
        const double *S
        int cost
        const double *condition
    ctypedef struct Rows:
        int rows, columns
        const double *A
        const double *b
        const double *shifted
    ctypedef struct Times:
        int rows
        const double *b
        const double *shifted
        const double *vanish
    ctypedef struct Event:
        Rows after, zero, most
        Times when
    ctypedef struct Problem:
        int phases
        const Phase *phase
        const Event *event
        Rows goal_zero, goal_most, goal_cost
        Times goal_when
        const double *soft
        const double *middle
        int spreads
        const double *spread
        const double *tie
        const double *shortest
        const double *longest
        double earliest, latest
        Shifts shifts
        int definitions
        double scale
    ctypedef struct Tree:
        double best
        double *at
        long boxes
        double shed
        size_t count, width
        double *waiting
        size_t left, keep
        double *leaves
        int fixed
    int tree_begin(Tree *, const Problem *, int, double, double, double, double, size_t)
    void tree_end(Tree *)
    int tree_push(Tree *, const double *)
    int tree_run(Tree *, long)
    double tree_bound(const Tree *)
    int tree_has_missed(const Tree *)
    int tree_is_stuck(const Tree *)


# Threads at most, and what the arrays of the engine have room for: phases, inputs of a step, numbers
# of a state, multipliers, rows of a step, prices, shifts that drive a phase; of shifts of surfaces, and
# of operations that make them.
MOST_WORKERS = MOST_THREADS
LIMITS = (
    MOST_PHASES, MOST_INPUTS, MOST_STATE, MOST_MULTIPLIERS, MOST_STEP_ROWS, MOST_PRICED, MOST_GIVEN,
)
LIMITS_OF_SHIFTS = MOST_SHIFTS, MOST_OPERATIONS
# Their names in the order of shifts.h.
OPERATIONS = (
    "sum", "product", "power", "negative", "square", "inverse", "root", "sine", "cosine", "exponential",
    "logarithm", "arctangent", "constant", "time",
)


cdef Shifts shifts_of(shifts, list held) except *:
    """Shifts, whose numbers stay where they are as long as the list does."""
    cdef const int[::1] operation = np.append(shifts.operations.ravel(), 0).astype(np.intc)
    cdef const int[::1] result = np.append(shifts.results, 0).astype(np.intc)
    cdef const double[::1] constant = np.append(shifts.constants.ravel(), 0.0)
    held.extend([operation, result, constant])
    return Shifts(len(shifts.operations), len(shifts.results), &operation[0], &constant[0], &result[0])


def enclosed(shifts, double low, double high):
    """Bounds of the shifts over a range of the time, from the middle: there of the value and the first
    two derivatives, over the range of these and of the third one, shape (shifts, 7, 2)."""
    cdef list held = []
    cdef line values[MOST_SHIFTS]
    cdef Shifts known = shifts_of(shifts, held)
    cdef double middle = low + (high - low) / 2
    cdef double[:, :, ::1] to = np.empty((known.shifts, 7, 2))
    if known.shifts:
        shifts_over(&known, interval(middle, middle), interval(low, high), values)
        memcpy(&to[0, 0, 0], values, known.shifts * sizeof(line))
    return np.asarray(to)


cdef class Branch:
    """Boxes of durations of a LinearProblem, and a bound of the cost of each.

    ``best`` is the cost of a motion that is known, infinite where there is none; without one,
    motions that cost ``limit`` or more are of no interest.  ``gap`` is relative to the least cost,
    and ``least_gap`` what it is at least.  Of the boxes that need not be divided further ``keep`` are
    kept.  ``workers`` are threads; all that comes of it is the same for any number of them.
    """
    cdef Tree tree
    cdef Problem problem
    cdef Phase phases[MOST_PHASES]
    cdef Event events[MOST_PHASES]
    cdef list held
    cdef bint begun
    cdef readonly tuple arguments

    def __init__(self, linear, double best, double limit, double gap, double least_gap, double scale,
                 size_t keep=0, int workers=1):
        cdef Py_ssize_t i
        self.held = []
        self.arguments = linear, best, limit, gap, least_gap, scale, keep, workers
        if linear.definitions > MOST_PRICED:
            raise ValueError("the engine has no room for so many definitions")
        for i, phase in enumerate(linear.phases):
            self.phases[i] = Phase(
                phase.size, phase.P.shape[1] - phase.size, len(phase.c), phase.steps, len(phase.most),
                len(phase.places), len(phase.drives), self._numbers(phase.places), self._numbers(phase.drives),
                self._numbers(phase.P), self._numbers(phase.R), self._numbers(phase.c), phase.c_0,
                self._numbers(phase.lower), self._numbers(phase.upper), self._numbers(phase.paths),
                self._numbers(phase.most), self._numbers(phase.since),
                self._numbers(phase.moves), self._numbers(phase.within), len(phase.S),
                len(phase.conditions), self._numbers(phase.S), phase.cost, self._numbers(phase.conditions),
            )
        for i, event in enumerate(linear.events):
            self.events[i] = Event(
                self._rows(event.after), self._rows(event.zero), self._rows(event.most),
                self._times(event.when),
            )
        earliest, latest = linear.final_time
        self.problem = Problem(
            len(linear.phases), &self.phases[0], &self.events[0], self._rows(linear.goal_zero),
            self._rows(linear.goal_most), self._rows(linear.goal_cost), self._times(linear.goal_when), self._numbers(linear.soft), self._numbers(linear.start[0]), len(linear.start) - 1,
            self._numbers(linear.start[1:]), self._numbers(linear.tie), self._numbers(linear.durations[:, 0]),
            self._numbers(linear.durations[:, 1]), earliest, latest, shifts_of(linear.shifts, self.held),
            linear.definitions, scale,
        )
        self.begun = True
        if tree_begin(&self.tree, &self.problem, workers, best, limit, gap, least_gap, keep):
            raise MemoryError

    def __dealloc__(self):
        if self.begun:
            tree_end(&self.tree)

    cdef const double *_numbers(self, values) except NULL:
        """Numbers that stay where they are as long as this does."""
        cdef double[::1] kept
        array = np.ascontiguousarray(values, dtype=float).ravel()
        kept = array if array.size else np.zeros(1)
        self.held.append(kept)
        return &kept[0]

    cdef Rows _rows(self, rows) except *:
        m, n = rows.A.shape
        return Rows(m, n, self._numbers(rows.A), self._numbers(rows.b), self._numbers(rows.shifted))

    cdef Times _times(self, when) except *:
        return Times(
            len(when.b), self._numbers(when.b), self._numbers(when.shifted), self._numbers(when.vanish),
        )

    def run(self, long boxes):
        """Look at so many boxes more; whether some are left that matter."""
        cdef int ending
        with nogil:
            ending = tree_run(&self.tree, boxes)
        if ending == NO_MEMORY:
            raise MemoryError
        return ending == GOING_ON

    @property
    def bound(self):
        """No motion costs less."""
        return tree_bound(&self.tree)

    @property
    def stuck(self):
        """Whether boxes lack prices of conditions along phases for which there is no room."""
        return bool(tree_is_stuck(&self.tree))

    @property
    def missed(self):
        """Whether a box of interest was left because it cannot be divided."""
        return bool(tree_has_missed(&self.tree))

    @property
    def best(self):
        """The least cost that was met."""
        return self.tree.best

    @property
    def durations(self):
        """Durations at which that was, shape (phases,); zeros where ``best`` was given."""
        return np.array([self.tree.at[i] for i in range(self.problem.phases)])

    @property
    def boxes(self):
        """How many boxes were looked at."""
        return self.tree.boxes

    @property
    def waiting(self):
        """How many wait."""
        return self.tree.count

    @property
    def leaves(self):
        """Boxes that were left, shape (boxes, 1 + 2 phases): bound, shortest and longest durations;
        None where there are more than are kept."""
        if self.tree.left > self.tree.keep:
            return None
        return self._table(self.tree.leaves, self.tree.left, 1 + 2 * self.problem.phases)

    cdef _table(self, const double *numbers, size_t rows, size_t width):
        """A copy, shape (rows, width)."""
        cdef double[:, ::1] to
        table = np.empty((rows, width))
        if rows:
            to = table
            memcpy(&to[0, 0], numbers, rows * width * sizeof(double))
        return table

    def state(self):
        """What another one goes on with: boxes that wait, shape (boxes, width); the leaves, without
        rows where there are too many; and least bound of those that were left, least cost, how many
        were looked at and left, and durations, shape (4 + phases,)."""
        leaves, w = self.leaves, 1 + 2 * self.problem.phases
        numbers = [self.tree.shed, self.best, self.boxes, self.tree.left, *self.durations]
        return {
            "waiting": self._table(self.tree.waiting, self.tree.count, self.tree.width),
            "leaves": np.empty((0, w)) if leaves is None else leaves,
            "numbers": np.array(numbers),
        }

    def _own(self, waiting):
        """Boxes that another one has left, with the prices that have the same numbers here."""
        shared = 1 + 2 * self.problem.phases + self.tree.fixed + self.problem.definitions
        boxes = np.zeros((len(waiting), self.tree.width))
        boxes[:, :shared], boxes[:, -1] = waiting[:, :shared], waiting[:, -1]
        return boxes

    def restore(self, waiting, leaves, numbers):
        """Go on where another one has stopped, which may have had other arrays."""
        cdef Py_ssize_t i
        cdef const double[:, ::1] boxes = self._own(waiting)
        cdef const double[:, ::1] done = np.ascontiguousarray(leaves)
        self.tree.count = 0
        for i in range(boxes.shape[0]):
            if tree_push(&self.tree, &boxes[i, 0]):
                raise MemoryError
        if 0 < <size_t>done.shape[0] <= self.tree.keep:
            memcpy(self.tree.leaves, &done[0, 0], done.size * sizeof(double))
        self.tree.shed, self.tree.boxes, self.tree.left = numbers[0], <long>numbers[2], <size_t>numbers[3]
        if numbers[1] < self.best:
            self.tree.best = numbers[1]
            for i in range(self.problem.phases):
                self.tree.at[i] = numbers[4 + i]
