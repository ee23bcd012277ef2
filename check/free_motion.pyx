# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False, initializedcheck=False, auto_pickle=False
"""The check of a motion that is free between hits without friction, compiled.

It measures what :mod:`dmoc.check.check` measures, by the same rules, for motions that pass: where
something is out of order, or needs words, it says so and measures no further.  A motion that nothing
closes, rubs, joins or limits beside its coordinates and inputs is most motions of a batch, and this
takes a fifth of the time.
"""
from libc.math cimport INFINITY, NAN, fabs, fmax, fmin, hypot, isfinite, pow, sqrt
from libc.stdlib cimport qsort
from libc.time cimport CLOCKS_PER_SEC, clock, clock_t

from dmoc_kernel cimport DMOC_MOST, dmoc_entry, find_kernel
from elimination cimport factor, largest_column, shortest, solve, squares, turn_columns

import numpy as np

import dmoc.check.amplification as _amplification
import dmoc.check.arcs as _arcs
import dmoc.check.checked_motion as _motion
import dmoc.check.consistency as _plan
import dmoc.check.depth as _depth
import dmoc.check.events as _events
import dmoc.check.integrals as _integrals
import dmoc.check.integrated_steps as _steps
import dmoc.check.passages as _passages
import dmoc.check.path_limits as _paths
import dmoc.check.quadrature as _quadrature
import dmoc.check.runs as _runs
import dmoc.check.segments as _segments
import dmoc.simulation.flow as _flow
import dmoc.simulation.roots as _roots
import dmoc.simulation.sizes as _sizes
from dmoc.base.tolerances import DEPENDENT, ROUNDING
from dmoc.check.checked_motion import nodes_of_segments
from dmoc.mechanics.conditions import GAPS, TANGENTS, conditions_among
from dmoc.mechanics.contact_mode import FREE
from dmoc.mechanics.contacts import NOWHERE, RAIL, contacts_of
from dmoc.motion.trajectory import GRAZING
from dmoc.simulation.contact_modes import Reaction
from dmoc.simulation.dormand_prince import shares, sums

cdef extern from "sums.h" nogil:
    enum: FOUR
    void sum_of(
        double *out, const double *slopes, ptrdiff_t count, ptrdiff_t stride, ptrdiff_t terms,
        const ptrdiff_t *which, const double *factor
    )

cdef enum:
    ERRORS = 11  # that are measured of a motion

# Share of the errors with which a motion passes up to which coarse integrations tell that it does.
cdef double CLEAR = 0.5

include "rows.pxi"
include "conditions.pxi"
include "dynamics.pxi"
include "dop853.pxi"
include "gaps.pxi"
include "free_sizes.pxi"
include "free_steps.pxi"
include "free_costs.pxi"
include "free_paths.pxi"
include "free_limits.pxi"
include "free_parts.pxi"
include "free_run.pxi"


cdef class FreeMotion(FreeRun):
    """Checks motions of one model on one mesh, one after the other with nothing of Python between
    two of them; for one thread.

    Parameters
    ----------
    kernels : Kernels
    scheme : Discretisation
        That of its order.
    """

    def measured(self, par, motion, double claim, check_time):
        """Measure a motion with the parameters par (1, npar) that says it costs ``claim``.

        ``motion`` is that of :func:`dmoc.check.compiled.arrays_of`.

        Returns
        -------
        None, or tuple
            None where it is out of order.  Otherwise its errors, in the order of
            :data:`dmoc.check.compiled.ERRORS`; errors of the segments, shape (n,); the
            amplification; and the contacts of the open-loop run as (surface, time, jump).
        """
        cdef bint is_measured
        cdef double errors[ERRORS]
        self._read(par, motion, check_time)
        with nogil:
            is_measured = self.measure(0, claim, errors, False)
        if not is_measured:
            return None
        contacts = [(c.surface, c.time, c.jump) for c in self.contacts[: self.contact_count]]
        segments = np.array(self.segment_errors[: self.S])
        return tuple(errors[i] for i in range(ERRORS)), segments, self.amplification, contacts

    def judge(
        self, par, motions, const double[::1] claims, const double[::1] most,
        unsigned char[::1] verdicts, check_time
    ):
        """Tell of R motions, rows of ``par`` and of :func:`dmoc.check.compiled.arrays_of`, that say
        they cost ``claims``, whether none of their errors exceeds ``most``.

        ``verdicts``, shape (R,), becomes 1 of those that pass and 0 of those that need another
        look; where ``check_time`` raises it keeps what it had of those that had no turn.  A motion
        of order 2 passes by integrations of order 4 too where these find at most half of what is
        allowed: where its errors are small, theirs are far smaller.
        """
        cdef ptrdiff_t row
        cdef bint order_2 = not self.nodes_inside.shape[0]
        self._read(par, motions, check_time)
        if not (self.count == claims.shape[0] == verdicts.shape[0] and most.shape[0] == ERRORS):
            raise ValueError(f"expected {self.count} motions and {ERRORS} errors")
        with nogil:
            for row in range(self.count):
                verdicts[row] = (
                    order_2 and self.passes(row, claims[row], &most[0], True)
                ) or self.passes(row, claims[row], &most[0], False)

    cdef bint passes(
        self, ptrdiff_t row, double claim, const double *most, bint coarse
    ) except -1 nogil:
        """Whether the errors of a row are those that it may have."""
        cdef ptrdiff_t i
        cdef double errors[ERRORS]
        cdef double share = CLEAR if coarse else 1.0
        if not self.measure(row, claim, errors, coarse):
            return False
        for i in range(ERRORS):
            if not errors[i] <= share * most[i]:
                return False
        return True

    def _read(self, par, motions, check_time):
        """Take motions, and what is called now and then."""
        self.check_time, self.looked_at = check_time, 0
        *states, rates, constant = motions
        self.load(par, states)
        self.limit(rates, constant)

    cdef bint measure(
        self, ptrdiff_t row, double claim, double *errors, bint coarse
    ) except -1 nogil:
        """Measure the errors of a row; False where it is out of order."""
        self.look_at(row)
        self.coarse = coarse
        if not self.is_measured(claim):
            return False
        errors[0], errors[1] = self.step_error, self.energy_error
        errors[2], errors[3] = self.law_error, self.own_error
        errors[4], errors[5] = self.cost_error, self.phase_error
        errors[6], errors[7] = self.path_excess, self.segment_error
        errors[8], errors[9] = self.penetration, self.limit_excess
        errors[10] = self.terminal
        return True

    cdef bint is_measured(self, double claim) except -1 nogil:
        """Whether all could be measured."""
        self.look_at_nodes()
        if not (self.measure_sizes() and self.holds_together()):
            return False
        self.integrate_steps()
        if not (self.judge_steps() and self.judge_cost(claim) and self.judge_limits()):
            return False
        self.integrate_segments()
        return (
            self.judge_hits() and self.judge_segments() and self.carry_errors() and self.run_open()
            and self.run_segments()
        )
