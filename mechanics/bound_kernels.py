"""The kernels of a model bound to its parameter values, evaluated at single states or rows of
them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.contact_mode import Event
from dmoc.mechanics.contacts import NOWHERE, Contacts, contacts_of

# Matrix outputs that are read here, and their kernels.
MATRICES = {
    "R_D": "residual_jac",
    "g_D": "surface_jac",
    "W_D": "within_jac",
    "gamma_D": "gap_rate_jac",
    "tau_D": "tangent_jac",
    "sigma_D": "slide_rate_jac",
    "phi_D": "joint_jac",
    "phi_dot_D": "joint_rate_jac",
    "p_D": "momentum_jac",
    "w_D": "crossing_jac",
    "C_d_D": "step_jac",
    "r_d_D": "path_jac",
    "z_d_D": "quantity_jac",
    "z_s_D": "quantity_value_jac",
    "r_s_D": "path_limit_jac",
    "s_D": "hidden_jac",
    "C_s_d_D": "lifted_jac",
    "Phi_D": "terminal_cost_jac",
    "T_min_D": "min_time_jac",
}
# Relative change of a coordinate or parameter that tells how much of a value comes from it.
NUDGE = 1e-3

Index = NDArray[np.intp]


@record(frozen=True, eq=False)
class BoundKernels:
    """Kernels bound to parameter values, with the sizes of their model.

    Attributes
    ----------
    kernels : Kernels
    par : array of shape (1, npar)
        As :func:`dmoc.mechanics.model_values.parameter_row` reads them.
    """

    kernels: Kernels
    par: Array

    @property
    def values(self) -> dict[str, float]:
        """Parameter values by name."""
        return dict(zip(self.kernels.parameters, self.par[0].tolist(), strict=True))

    @cached_property
    def nq(self) -> int:
        """Number of coordinates."""
        return len(self.kernels.coordinates)

    @cached_property
    def nu(self) -> int:
        """Number of inputs."""
        return len(self.kernels.inputs)

    @cached_property
    def nc(self) -> int:
        """Number of surfaces."""
        return len(self.kernels.surfaces)

    @cached_property
    def nt(self) -> int:
        """Number of tangents."""
        return len(self.kernels.tangents)

    @cached_property
    def contacts(self) -> Contacts:
        """Surfaces and tangents of the model."""
        return contacts_of(self.kernels.manifest)

    @property
    def surface_numbers(self) -> dict[str, int]:
        """The place of each surface in the model."""
        return self.contacts.surface_numbers

    @property
    def tangent_numbers(self) -> dict[str, int]:
        """The place of each tangent in the model."""
        return self.contacts.tangent_numbers

    @property
    def supports(self) -> tuple[int, ...]:
        """The surface that each tangent belongs to, or RAIL."""
        return self.contacts.supports

    @cached_property
    def surface_coordinates(self) -> tuple[list[int], ...]:
        """The coordinates that the gap to each surface depends on."""
        on = self.kernels.manifest.surface_coordinates
        return tuple(on[name] for name in self.kernels.surfaces)

    def coordinates_at(self, event: Event) -> Sequence[int]:
        """The coordinates that say where an event is: of the surface that is hit, or of what a
        switch contains."""
        if event.switch != NOWHERE:
            return self.kernels.manifest.crossings[event.switch]["coordinates"]
        return self.surface_coordinates[event.hit] if event.hit != NOWHERE else ()

    @cached_property
    def ends(self) -> dict[int, list[int]]:
        """The surfaces that have ends, and the coordinates that these depend on."""
        return {self.surface_numbers[n]: on for n, on in self.kernels.manifest.within.items()}

    @cached_property
    def tangent_coordinates(self) -> tuple[list[int], ...]:
        """The coordinates that each tangential position depends on."""
        on = self.kernels.manifest.tangent_coordinates
        return tuple(on[name] for name in self.kernels.tangents)

    @property
    def nw(self) -> int:
        """Number of crossing functions."""
        return len(self.kernels.manifest.crossings)

    @cached_property
    def moving(self) -> frozenset[int]:
        """Surfaces that move with the time."""
        return frozenset(
            self.surface_numbers[name] for name in self.kernels.manifest.moving_surfaces
        )

    @cached_property
    def nj(self) -> int:
        """Number of joints."""
        return len(self.kernels.joints)

    @cached_property
    def hidden_names(self) -> tuple[str, ...]:
        """Names of the hidden unknowns."""
        facts = self.kernels.manifest
        pairs = zip(facts.hidden, facts.hidden_of, strict=True)
        return tuple(f"{name} in {of or 'the cost'}" for name, of in pairs)

    @cached_property
    def ns(self) -> int:
        """Number of hidden unknowns."""
        return len(self.kernels.manifest.hidden)

    @cached_property
    def ny(self) -> int:
        """Number of accelerations and forces y = (a | N | T | R) that kernels of quantities take:
        none where no quantity contains forces."""
        return (self.nq + self.nc + self.nt + self.nj) * self.kernels.has_forces

    def _at(self, kernel: str, q: Array, *rows: ArrayLike) -> tuple[Array, ...]:
        """Results of a kernel at rows of states, or at a single one without the leading axis."""
        results = self.kernels.call(kernel, q, *rows, self.par)
        return results if q.ndim > 1 else tuple([a[0] for a in results])

    def _values(self, kernel: str, count: int, q: Array, *rows: ArrayLike) -> Array:
        """The only result of a kernel, shape (..., count); without values a model has no kernel."""
        return self._at(kernel, q, *rows)[0] if count else np.zeros((*q.shape[:-1], 0))

    def _matrix(self, name: str, shape: tuple[int, int], q: Array, *rows: ArrayLike) -> Array:
        """A matrix of first derivatives, the one of its kernel; a model has none of no rows."""
        if not shape[0]:
            return np.zeros((*q.shape[:-1], *shape))
        return self._full(name, self._at(MATRICES[name], q, *rows)[0])

    def _bent(self, rate_D: str, count: int, q: Array, v: Array, t: ArrayLike) -> Array:
        """Changes of rates along v and with the time, without acceleration, shape (..., count)."""
        slopes = self._matrix(rate_D, (count, 2 * self.nq + 1), q, v, t)
        along = (slopes[..., : self.nq] @ v[..., None])[..., 0]
        return np.asarray(along + slopes[..., 2 * self.nq])

    def _sizes(self, kernel: str, count: int, q: Array, t: ArrayLike) -> Array:
        """Sizes of the values of a kernel at positions (..., nq) and times (...): the sum of what
        each coordinate and each parameter contributes, shape (..., count)."""
        lead = q.shape[:-1]
        numbers = np.concatenate([q, np.broadcast_to(self.par[0], (*lead, self.par.shape[1]))], -1)
        size = numbers.shape[-1]
        if not count:
            return np.zeros((*lead, 0))
        nudged = (1 + NUDGE * np.eye(size + 1, size, -1)) * numbers[..., None, :]
        rows = nudged.reshape(-1, size)
        times = np.repeat(np.broadcast_to(t, lead), size + 1)
        results = self.kernels.call(kernel, rows[:, : self.nq], times, rows[:, self.nq :])[0]
        of_each = results.reshape(*lead, size + 1, count)
        return np.asarray(np.abs(of_each[..., 1:, :] - of_each[..., :1, :]).sum(axis=-2) / NUDGE)

    def _state(self, v: Array | None) -> Array:
        return self._rest if v is None else v

    def _input(self, u: Array | None) -> Array:
        return self._idle if u is None else u

    @cached_property
    def _rest(self) -> Array:
        return np.zeros((1, self.nq))

    @cached_property
    def _idle(self) -> Array:
        return np.zeros((1, self.nu))

    def _full(self, matrix: str, stored: Array) -> Array:
        """Matrices from their stored entries, shape (..., rows, columns)."""
        kernel = MATRICES[matrix]
        rows, columns = self.kernels.pattern(kernel, matrix)
        shape = self.kernels.shape(kernel, matrix)
        full = np.zeros((*stored.shape[:-1], *shape))
        full[..., rows, columns] = stored
        return full
