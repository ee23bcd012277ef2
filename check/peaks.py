"""The peaks of a motion along the paths that are integrated from each node, beside those that it
says."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.check.checked_motion import Motion
from dmoc.check.findings import Findings, infinite_where_none
from dmoc.check.hits import hit_peaks
from dmoc.check.integrated_steps import IntegratedSteps
from dmoc.check.limit_functions import LimitFunctions
from dmoc.check.path_limits import ALMOST_NOTHING, counted
from dmoc.codegen.kernels import Array

PEAK = "error of a peak"


def peak_errors(motion: Motion, courses: Sequence[IntegratedSteps]) -> tuple[Array, Findings]:
    """The peaks of quantities, and the errors of those that the motion says, relative to the
    largest magnitude.  Between quadrature points, where quantities vary more, they count as path
    constraints do."""
    model, totals = motion.model, motion.trajectory.totals
    at_hits, of_hits = hit_peaks(motion)
    if not model.peaks_of:
        return at_hits, _findings(of_hits)
    functions = LimitFunctions.of(motion)
    states, at_points, after = functions.visited(courses)
    values, rows = model.quantities(*functions.split(states)), model.kernels.quantity_rows
    slopes = np.abs(model.quantity_slopes(*functions.split(states)))
    moved = np.nan_to_num(slopes @ functions.sizes(states), posinf=0.0).max(axis=0)
    peaks, errors = np.zeros(len(model.peaks_of)), dict[float, str]()
    for k, ((j, both), name) in enumerate(zip(model.peaks_of, model.peak_names, strict=False)):
        z, counts = values[:, j], counted(motion, [rows[j]], at_points, after)[:, 0]
        row = infinite_where_none(np.abs(z) if both else z)
        peaks[k] = row[counts == 1].max()
        claim = totals.get(name, float(peaks[k]))
        above = float((counts * (row - claim))[counts > 0].max())
        size = max(np.abs(z).max(), abs(claim), ALMOST_NOTHING * moved[j])
        error = max(claim - peaks[k], above) / (size or 1.0)
        errors[float(error)] = f"{name} is {peaks[k]:.6g} along the motion, not {claim:.6g}"
    return np.append(peaks, at_hits), _findings(errors | of_hits)


def _findings(errors: dict[float, str]) -> Findings:
    """The largest of the errors, with its sentence."""
    worst = max(errors, default=0.0)
    return Findings({PEAK: worst}, (), {PEAK: errors[worst]} if errors else {})
