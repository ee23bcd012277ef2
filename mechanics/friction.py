"""The friction of a model: its coefficients, which may vary along a motion."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import BoundKernels, Index
from dmoc.mechanics.contacts import RAIL
from dmoc.motion.impact_laws import law_of


class FrictionModel(BoundKernels):
    """Kernels bound to parameter values, and coefficients of friction."""

    @cached_property
    def friction(self) -> Array:
        """Coefficients mu of surfaces that slide and largest forces of rails, in the order of the
        tangents, shape (nt,); not a number where they vary, (..., nt) of
        :meth:`with_friction_at`."""
        return self._coefficients[0]

    @cached_property
    def static_friction(self) -> Array:
        """Coefficients of tangents that stick, and largest forces of rails, as ``friction``, shape
        (nt,); not a number where they vary, (..., nt) of :meth:`with_friction_at`."""
        return self._coefficients[-1]

    @cached_property
    def paired(self) -> NDArray[np.bool_]:
        """Tangents whose static friction is not their kinetic one, shape (nt,)."""
        names = self.kernels.manifest.static_friction
        return np.array([name in names for name in self.kernels.tangents], dtype=bool)

    @cached_property
    def _coefficients(self) -> list[Array]:
        """Kinetic coefficients, and static ones where a tangent has some, shape (nt,) each."""
        if not self.nt:
            return [np.zeros(0)]
        kinds = [np.array(mu[0]) for mu in self.kernels.call("friction", self.par)]
        if self._chosen:
            in_states = self._in_kernels(self._rest[0], 0.0, None, None)
            for mu, values in zip(kinds, in_states, strict=True):
                mu[self._chosen] = values[self._chosen]
        for mu in kinds:
            mu[list(self.varying_friction)] = np.nan
        return kinds

    @cached_property
    def varying_friction(self) -> dict[int, Mapping[str, Any]]:
        """The tangents whose friction varies along a motion, and what it depends on."""
        return {k: row for k, row in self._in_states.items() if k not in self._chosen}

    @cached_property
    def _in_states(self) -> dict[int, Mapping[str, Any]]:
        """The tangents whose friction is a kernel of states, and what it depends on."""
        rows = self.kernels.manifest.varying_friction
        return {self.tangent_numbers[row["name"]]: row for row in rows}

    @cached_property
    def _chosen(self) -> list[int]:
        """Tangents in ``_in_states`` whose friction varies with a design alone."""
        parts = "coordinates", "velocities", "inputs", "time"
        return [k for k, row in self._in_states.items() if not any(row[part] for part in parts)]

    def _in_kernels(self, q: Array, t: ArrayLike, v: Array | None, u: Array | None) -> list[Array]:
        """Coefficients at states, of tangents whose friction is a kernel of these, shape (..., nt)
        each: kinetic ones, and static ones where a tangent has some."""
        u, one = self._input(u), np.ones((1, self.nt))
        speeds = 0 * one
        if self.slows and v is not None:
            speeds = np.abs(self.slide_rates(q, v, t))
        rows = speeds, u, u, np.zeros((1, 1)), one, t
        kernels = ("bearing", "holding")[: 1 + self.kernels.has("holding")]
        return [self._at(kernel, q, *rows)[0] for kernel in kernels]

    @cached_property
    def slows(self) -> bool:
        """Whether some friction depends on the sliding speed."""
        return self.kernels.has("dragging")

    def with_friction_at(
        self, q: Array, v: Array | None = None, u: Array | None = None, t: ArrayLike = 0.0
    ) -> Self:
        """The same model with the friction that it has at states q, v and u of shapes (..., nq),
        (..., nq) and (..., nu)."""
        if not self.varying_friction:
            return self
        varies, kinds = list(self.varying_friction), list[Array]()
        for mu, values in zip(self._coefficients, self._in_kernels(q, t, v, u), strict=True):
            kinds.append(np.broadcast_to(mu, (*q.shape[:-1], self.nt)).copy())
            kinds[-1][..., varies] = values[..., varies]
        return self.with_coefficients(*kinds)

    def in_impact_at(self, q: Array, t: ArrayLike = 0.0) -> Self:
        """The same model with its friction in impacts at positions of shape (..., nq), where
        tangents that stick have the kinetic friction too."""
        there = self.with_friction_at(q, t=t)
        return there.with_coefficients(there.friction) if self.paired.any() else there

    def with_coefficients(self, *kinds: Array) -> Self:
        """The same model with kinetic coefficients of friction, and static ones if others are
        given, shape (..., nt)."""
        there = copy(self)
        there.__dict__ |= {"has_friction": self.has_friction, "friction": kinds[0]}
        there.__dict__ |= {"static_friction": kinds[-1]}
        there.__dict__.pop("hit_friction", None)
        return there

    def slide_rates(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Sliding velocities sigma, shape (..., nt)."""
        return self._values("slide_rate", self.nt, q, v, t)

    @cached_property
    def has_friction(self) -> NDArray[np.bool_]:
        """Which tangents have friction, shape (nt,): that which varies may be zero somewhere."""
        in_states = np.zeros(self.nt, dtype=bool)
        in_states[list(self._in_states)] = True
        return np.asarray(in_states | (self.friction != 0) | (self.static_friction != 0))

    @cached_property
    def rough(self) -> dict[int, int]:
        """The tangent of each surface with friction."""
        return {
            self.supports[k]: k
            for k in self.contacts.lines
            if self.supports[k] != RAIL and self.has_friction[k]
        }

    @cached_property
    def tangential_restitution(self) -> Array:
        """Coefficients e_t of tangents, -1 where the model states none, shape (nt,)."""
        if not self.kernels.has("tangential"):
            return np.full(self.nt, -1.0)
        return np.asarray(self.kernels.call("tangential", self.par)[0][0])

    @cached_property
    def hit_friction(self) -> Array:
        """Coefficients of friction in hits, shape (nt,): without end where a tangent has tangential
        restitution alone."""
        names, without = self.kernels.tangents, self.contacts.frictionless
        return np.where([name in without for name in names], np.inf, self.friction)

    @cached_property
    def rubs_in_hits(self) -> dict[int, int]:
        """The tangent of each surface whose hits have a tangential impulse."""
        free = self.contacts.frictionless
        rubs = [self.has_friction[k] or t in free for k, t in enumerate(self.kernels.tangents)]
        pairs = ((self.supports[k], k) for k in self.contacts.lines if rubs[k])
        return {j: k for j, k in pairs if j != RAIL}

    @cached_property
    def impact_laws(self) -> dict[int, str]:
        """The law that these hits obey, by surface (:mod:`dmoc.motion.impact_laws`)."""
        manifest, names = self.kernels.manifest, self.kernels.surfaces
        facts = manifest.impact_laws, manifest.tangential_restitution
        return {j: law_of(names[j], *facts) for j in self.rubs_in_hits}

    def bearing(self, normal: Array) -> Array:
        """Largest static friction beside contact forces (..., nc): mu_s N of surfaces, and the
        largest force of rails, shape (..., nt)."""
        return self._pressing(self.static_friction, normal)

    def dragging(self, normal: Array) -> Array:
        """Sizes of the friction of sliding tangents beside contact forces (..., nc), shape (...,
        nt)."""
        return self._pressing(self.friction, normal)

    def _pressing(self, mu: Array, normal: Array) -> Array:
        on, rails = self._pressed
        if rails is None:
            return np.asarray(mu * normal[..., on])
        pressed = np.append(normal, np.ones((*normal.shape[:-1], 1)), axis=-1)
        return np.asarray(mu * pressed[..., rails])

    @cached_property
    def _pressed(self) -> tuple[Index, Index | None]:
        """The surface of each tangent, and where there are rails the same with one surface more,
        the last, for these."""
        on = np.array(self.supports, dtype=np.intp)
        return on, np.where(on == RAIL, self.nc, on) if (on == RAIL).any() else None
