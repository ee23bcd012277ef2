"""A table of hits: each row the states before and after one, of which nothing else was measured."""

from __future__ import annotations

import numpy as np

from dmoc.base.errors import FitError
from dmoc.base.names import velocity_name
from dmoc.base.records import record
from dmoc.check.impact_law import ImpactLaw
from dmoc.codegen.kernels import Array
from dmoc.fitting.course import Course, Laws
from dmoc.fitting.data import Run
from dmoc.fitting.experiment import Experiment, Places, Prediction
from dmoc.fitting.parameters import Parameter
from dmoc.mechanics.contact_mode import Event
from dmoc.mechanics.touch import Touch
from dmoc.problem.problem import Problem
from dmoc.simulation.impact_laws.course import Coefficients
from dmoc.simulation.impact_laws.laws import LAWS


def experiment_of(
    problem: Problem, run: Run, touch: Touch, unknowns: tuple[Parameter, ...], start: Array
) -> Experiment:
    """A run, or a table of hits, with the unknowns that it depends on.

    Raises
    ------
    FitError
        If a table of hits belongs to a sequence that is not one hit.
    """
    if not run.before:
        return Experiment(problem, run, touch, unknowns, start)
    if len(touch.events) != 1 or not touch.events[0].impact:
        raise FitError(
            f"{run.name} is a table of hits, and its sequence has {len(touch.events)} events: give "
            "the one that is hit, sequence=['floor']."
        )
    nothing = Touch(touch.contacts, touch.modes[1:], ())
    known = np.where(np.isfinite(start), start, 0.0)
    return HitTable(problem, run, nothing, unknowns, known, touch.events[0])


@record(frozen=True, eq=False)
class HitTable(Experiment):
    """Hits of one surface, each from a state of its own: those that a row does not tell are of the
    start."""

    event: Event

    def predict(
        self, x: Array, phases: Places | None = None, near: Array | None = None
    ) -> Prediction:
        laws, nq = self.laws(x), self.problem.nq
        after = self._after(laws, self.states[:, :nq].copy(), self.states[:, nq:].copy())
        names = [f"{velocity_name(q)} after" for q in self.problem.kernels.coordinates]
        values = np.empty(len(self.measured))
        for name, s in self.run.sensors.items():
            bias, gain, _ = self.sensed(name, x)
            values[self.slices[name]] = gain * after[s.rows, names.index(name)] + bias
        course = Course((), laws, self._still)
        return Prediction(course, values, np.zeros(len(values), dtype=np.intp))

    @property
    def states(self) -> Array:
        """States before the hits (rows, 2 nq)."""
        names = self.problem.kernels.coordinates
        states = [*names, *map(velocity_name, names)]
        rows = np.tile(self.start, (self.run.rows, 1))
        for name, values in self.run.before.items():
            rows[:, states.index(name)] = values
        return rows

    def _after(self, laws: Laws, q: Array, v: Array) -> Array:
        """Velocities after hits from states (rows, nq)."""
        law, t = laws.law_of(self.event, self.touch.modes[0]), np.zeros(len(q))
        model = laws.model
        held = law.holding.closed or model.nj or law.hit in model.contacts.in_space
        if law.rubs is None or held or model.varying_friction:
            return law.after(q, v, t).velocity
        return self._rubbing(law, q, v)

    def _rubbing(self, law: ImpactLaw, q: Array, v: Array) -> Array:
        """Velocities after hits with friction that touch nothing else, all at once but for their
        courses."""
        model, j, k = law.model.in_impact_at(q[0]), law.hit, law.rubs
        assert j is not None and k is not None
        slopes = model.gap_slopes(q)[:, j, :-1], model.tangent_slopes(q)[:, k, :-1]
        D = np.stack([-slopes[0], slopes[1]], axis=1)
        pushed = model.responses(q, D)
        e = model.coefficients(law.restitution, q, v, np.zeros(len(q)))[:, j]
        rates = np.stack([-model.gap_rates(q, v)[:, j], model.slide_rates(q, v)[:, k]], axis=1)
        mu, e_t = float(model.hit_friction[k]), float(model.tangential_restitution[k])
        ways = [
            LAWS[law.by](rate, response, Coefficients(mu, float(one), e_t))
            for rate, response, one in zip(
                rates, D @ pushed, 0 * e if law.lands else e, strict=True
            )
        ]
        lam = np.array([(way.normal, way.tangential) for way in ways])
        return np.asarray(v + (pushed @ lam[..., None])[..., 0])
