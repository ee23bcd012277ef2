# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False, initializedcheck=False, auto_pickle=False
"""The check of a motion that is free between hits without friction, compiled.

It measures what :mod:`dmoc.check.check` measures, by the same rules, for motions that pass: where
something is out of order, or needs words, it says so and measures no further.  A motion that nothing
closes, rubs, joins or limits beside its coordinates and inputs is most motions of a batch, and this
takes a fifth of the time.
"""
from libc.math cimport INFINITY, NAN, fabs, fmax, fmin, isfinite, pow, sqrt
from libc.stdlib cimport qsort

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
import dmoc.simulation.flow as _flow
import dmoc.simulation.roots as _roots
import dmoc.simulation.sizes as _sizes
from dmoc.base.tolerances import DEPENDENT, ROUNDING
from dmoc.check.checked_motion import nodes_of_segments
from dmoc.mechanics.conditions import GAPS, TANGENTS, conditions_among
from dmoc.mechanics.contact_mode import FREE
from dmoc.mechanics.contacts import RAIL, Contacts
from dmoc.motion.trajectory import GRAZING
from dmoc.simulation.contact_modes import Reaction
from dmoc.simulation.dormand_prince import shares, sums

cdef extern from "sums.h" nogil:
    enum: FOUR
    void sum_of(
        double *out, const double *slopes, ptrdiff_t count, ptrdiff_t stride, ptrdiff_t terms,
        const ptrdiff_t *which, const double *factor
    )

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
    """Checks motions of one model on one mesh, one after the other; for one thread.

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
            None where it is out of order.  Otherwise the errors of steps, energy, the law of impact
            and that relative to its own rates, of the cost, of phases, the excess of path
            constraints, the error of the end, penetration, the excess of limits and the
            amplification; errors of the segments, shape (n,); and the contacts of the open-loop run
            as (surface, time, jump).
        """
        cdef bint passes
        self.check_time = check_time
        *states, rates, constant = motion
        self.load(par, states)
        self.limit(rates, constant)
        with nogil:
            passes = self.passes(claim)
        if not passes:
            return None
        contacts = [(c.surface, c.time, c.jump) for c in self.contacts[: self.contact_count]]
        errors = (
            self.step_error, self.energy_error, self.law_error, self.own_error, self.cost_error,
            self.phase_error, self.path_excess, self.terminal, self.penetration, self.limit_excess,
            self.amplification,
        )
        return errors, np.array(self.segment_errors[: self.S]), contacts

    cdef bint passes(self, double claim) except -1 nogil:
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
