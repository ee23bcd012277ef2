"""Forces and impacts of lasting contacts with Coulomb friction, by trying every mode.

With the gaps g <= 0, their normals n = dg/dq and tangents d = dtau/dq::

    M a = F - sum lam_n n + sum lam_t d

where each contact is open (lam = 0, the gap opens), sticks (d . a + ... = 0, |lam_t| <= mu lam_n),
or slides with the sign s (lam_t = -s mu lam_n); a rail has a given mu lam_n.  All combinations are
tried, the last one first.  An impact is Newton's where nothing rubs; one contact that rubs, alone,
obeys Poisson's law, integrated in the normal impulse; plastic impacts of several are looked for
like forces.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from equations import Description, Mechanism, _numeric
from sympy.physics.mechanics import dynamicsymbols

Array = np.ndarray
OPEN, CLOSED, STICK = "open", "closed", "stick"  # beside the signs +1 and -1 of sliding
# Of the motion's sizes: what is so near is closed; what moves as slowly as the discretisation errs
# does not.
NEAR, SLOW = 1e-5, 2e-3
SLACK = 1e-6  # of the largest force or impulse, by which a sign may be missed


def slides(status: Any) -> bool:
    """Whether the status of a contact is a sign of sliding."""
    return isinstance(status, int)


@dataclass(frozen=True)
class ContactSizes:
    """Of a motion: gaps (nc,), their rates (nc,), sliding rates (nt,) and the time."""

    gap: Array
    rate: Array
    slide: Array
    time: float


@dataclass(frozen=True)
class ContactForces:
    """A consistent set: statuses of surfaces and rails, accelerations or velocities, normal forces
    (nc,) and friction forces (nt,), or impulses."""

    mode: tuple[Any, ...]
    motion: Array
    normal: Array
    tangential: Array


class ContactEquations(Mechanism):
    """Equations of motion with contacts and friction; everything is a function of the row ``par``
    of parameter values."""

    def __init__(self, system: Description) -> None:
        super().__init__(system)
        t = dynamicsymbols._t
        q, v = (sp.symbols(f"{a}:{self.nq}") for a in ("q_", "v_"))
        tau, par = sp.Symbol("tau_time"), list(system.parameters)
        names = dict(zip(system.coordinates, q, strict=True))

        def kinematics(expressions: Sequence[Any]) -> Callable[..., list[float]]:
            """Values, rates, slopes by q, and what accelerations have beside slope . a."""
            plain = [sp.sympify(e).subs(names).subs(t, tau) for e in expressions]
            results: list[Any] = [*plain]
            slopes = [[e.diff(s) for s in q] for e in plain]
            rates = [
                sum((d * s for d, s in zip(row, v, strict=True)), e.diff(tau))
                for row, e in zip(slopes, plain, strict=True)
            ]
            results += rates + [d for row in slopes for d in row]
            results += [
                sum((r.diff(a) * b for a, b in zip(q, v, strict=True)), r.diff(tau)) for r in rates
            ]
            return _numeric([*q, *v, tau, *par], results)

        self.tangents = list(system.tangents)
        self.rails = [k for k, name in enumerate(self.tangents) if name not in self.surfaces]
        self.rubs = {
            self.surfaces.index(name): k
            for k, name in enumerate(self.tangents)
            if name in self.surfaces
        }
        self._gap_motion = kinematics([r.lts - r.gts for r in system.surfaces.values()])
        self._slide_motion = kinematics(list(system.tangents.values()))
        self._friction = _numeric(par, [sp.sympify(f) for f in system.friction.values()])

    def friction(self, par: Array) -> Array:
        """Coefficients, or forces of rails, in the order of the tangents."""
        return np.array(self._friction(*par), dtype=float)

    def _kinematics(
        self, function: Callable[..., list[float]], n: int, q: Array, v: Array, t: float, par: Array
    ) -> tuple[Array, Array, Array, Array]:
        values = np.array(function(*q, *v, t, *par), dtype=float)
        return (
            values[:n],
            values[n : 2 * n],
            values[2 * n : 2 * n + n * self.nq].reshape(n, self.nq),
            values[2 * n + n * self.nq :],
        )

    def gap_motion(
        self, q: Array, v: Array, t: float, par: Array
    ) -> tuple[Array, Array, Array, Array]:
        return self._kinematics(self._gap_motion, len(self.surfaces), q, v, t, par)

    def slide_motion(
        self, q: Array, v: Array, t: float, par: Array
    ) -> tuple[Array, Array, Array, Array]:
        return self._kinematics(self._slide_motion, len(self.tangents), q, v, t, par)

    def conditions(self, q: Array, v: Array, t: float, par: Array) -> tuple[Array, ...]:
        """Slopes and rests of the accelerations of gaps, then of tangents."""
        return (*self.gap_motion(q, v, t, par)[2:], *self.slide_motion(q, v, t, par)[2:])

    # Forces ---------------------------------------------------------------------------------------

    def near(
        self,
        q: Array,
        v: Array,
        t: float,
        par: Array,
        sizes: ContactSizes,
        passed: Collection[int] = (),
    ) -> list[int]:
        """Surfaces that are touched and not approached or left."""
        g, w, _, _ = self.gap_motion(q, v, t, par)
        close = (g > -NEAR * sizes.gap) & (np.abs(w) < SLOW * sizes.rate)
        return [int(j) for j in np.flatnonzero(close) if j not in passed]

    def _choices(self, near: Sequence[int], sigma: Array, sizes: ContactSizes) -> list[list[Any]]:
        """Statuses that each surface (nc) and each rail may have."""

        def rubbing(k: int) -> list[Any]:
            if abs(sigma[k]) > SLOW * sizes.slide[k]:
                return [int(np.sign(sigma[k]))]
            return [STICK, 1, -1]

        choices: list[list[Any]] = []
        for j in range(len(self.surfaces)):
            held = rubbing(self.rubs[j]) if j in self.rubs else [CLOSED]
            choices.append([*held, OPEN] if j in near else [OPEN])
        return choices + [rubbing(k) for k in self.rails]

    def solved(
        self, mode: Sequence[Any], M: Array, force: Array, parts: tuple[Array, ...], mu: Array
    ) -> ContactForces | None:
        """The motion z with M z = force - lam_n n + lam_t d and the conditions of a mode, slopes
        and rests of gaps and tangents; none where the mode does not determine it."""
        n, rest_n, d, rest_d = parts
        nc, unknowns, conditions = len(self.surfaces), list[Array](), list[tuple[Array, float]]()
        loads: list[tuple[str, int]] = []
        force = force.copy()
        for j, status in enumerate(mode[:nc]):
            if status == OPEN:
                continue
            push = -n[j]
            if slides(status):
                push = push - status * mu[self.rubs[j]] * d[self.rubs[j]]
            unknowns.append(push)
            loads.append(("n", j))
            conditions.append((n[j], rest_n[j]))
            if status == STICK:
                unknowns.append(d[self.rubs[j]])
                loads.append(("t", self.rubs[j]))
                conditions.append((d[self.rubs[j]], rest_d[self.rubs[j]]))
        for k, status in zip(self.rails, mode[nc:], strict=True):
            if status == STICK:
                unknowns.append(d[k])
                loads.append(("t", k))
                conditions.append((d[k], rest_d[k]))
            else:
                force -= status * mu[k] * d[k]
        size = self.nq + len(unknowns)
        A, b = np.zeros((size, size)), np.zeros(size)
        A[: self.nq, : self.nq], b[: self.nq] = M, force
        for i, (push, (slope, rest)) in enumerate(zip(unknowns, conditions, strict=True)):
            A[: self.nq, self.nq + i] = -push
            A[self.nq + i, : self.nq], b[self.nq + i] = slope, -rest
        scale = np.sqrt(np.maximum(np.abs(np.diag(A)), 1e-300))
        scale[self.nq :] = 1.0
        try:
            if np.linalg.cond(A / scale[:, None] / scale) > 1e12:
                return None
            z = np.linalg.solve(A, b)
        except np.linalg.LinAlgError:
            return None
        normal, tangential = np.zeros(nc), np.zeros(len(self.tangents))
        for value, (kind, i) in zip(z[self.nq :], loads, strict=True):
            (normal if kind == "n" else tangential)[i] = value
        for j, status in enumerate(mode[:nc]):
            if slides(status):
                tangential[self.rubs[j]] = -status * mu[self.rubs[j]] * normal[j]
        for k, status in zip(self.rails, mode[nc:], strict=True):
            if status != STICK:
                tangential[k] = -status * mu[k]
        return ContactForces(tuple(mode), z[: self.nq], normal, tangential)

    def _holds(
        self,
        f: ContactForces,
        near: Sequence[int],
        parts: tuple[Array, ...],
        mu: Array,
        still: Array,
    ) -> bool:
        """Whether no contact pulls, leaves its cone, enters its surface or slides the wrong way;
        ``still`` are the tangents that do not slide yet."""
        n, rest_n, d, rest_d = parts
        nc = len(self.surfaces)
        largest = max(float(np.abs(np.append(f.normal, f.tangential)).max(initial=0.0)), 1e-12)
        opens, sliding = n @ f.motion + rest_n, d @ f.motion + rest_d
        speed = max(float(np.abs(f.motion).max()), 1e-12)
        for j in near:
            if f.mode[j] == OPEN:
                if opens[j] > SLACK * speed * np.abs(n[j]).sum():
                    return False
            elif f.normal[j] < -SLACK * largest:
                return False
        statuses = [(k, f.mode[j], mu[k] * max(f.normal[j], 0.0)) for j, k in self.rubs.items()]
        statuses += [(k, s, mu[k]) for k, s in zip(self.rails, f.mode[nc:], strict=True)]
        for k, status, most in statuses:
            if status in (OPEN, CLOSED):
                continue
            if status == STICK and abs(f.tangential[k]) > most + SLACK * largest:
                return False
            least = -SLACK * speed * np.abs(d[k]).sum()
            if slides(status) and still[k] and status * sliding[k] < least:
                return False
        return True

    def forces(
        self, q: Array, v: Array, u: Array, t: float, par: Array, sizes: ContactSizes,
        last: tuple[Any, ...] = (), passed: Collection[int] = (), over: bool = False,
    ) -> ContactForces:  # fmt: skip
        """Consistent forces and accelerations; those of the ``last`` mode where it still is
        possible, and where it is ``over`` those of another one."""
        M, F = self.motion(q, v, u, t, par)
        parts, mu = self.conditions(q, v, t, par), self.friction(par)
        sigma = self.slide_motion(q, v, t, par)[1]
        near = self.near(q, v, t, par, sizes, passed)
        still = np.abs(sigma) <= SLOW * sizes.slide
        choices = self._choices(near, sigma, sizes)
        modes = list(itertools.product(*choices))
        modes.sort(key=lambda mode: (mode != last) != over)
        for mode in modes:
            f = self.solved(mode, M, F, parts, mu)
            if f is not None and self._holds(f, near, parts, mu, still):
                return f
        raise ArithmeticError(f"no consistent forces at {t:.6g} s")

    # Impacts --------------------------------------------------------------------------------------

    def impacts(
        self, hit: Sequence[int], q: Array, v: Array, u: Array, t: float, par: Array,
        sizes: ContactSizes, e: Sequence[float], passed: Collection[int] = (),
    ) -> Iterator[ContactForces]:  # fmt: skip
        """Every outcome of an impact on some surfaces that the laws allow."""
        M = self.motion(q, v, u, t, par)[0]
        g, w, n, _ = self.gap_motion(q, v, t, par)
        _, sigma, d, _ = self.slide_motion(q, v, t, par)
        mu = self.friction(par)
        touched = [int(j) for j in np.flatnonzero(g > -NEAR * sizes.gap)]
        touched = sorted({*(j for j in touched if j not in passed), *hit})
        bounce = np.array([e[j] if j in hit else 0.0 for j in range(len(self.surfaces))])
        rough = [j for j in touched if j in self.rubs and mu[self.rubs[j]] > 0]
        if len(hit) == 1 and rough == list(hit) and len(touched) == 1:
            yield self._poisson(hit[0], M, v, w[hit[0]], n, d, sigma, mu, bounce[hit[0]])
        # rest of the conditions: rate after = -e rate before, sliding after = 0
        gap_rest = self.gap_motion(q, np.zeros(self.nq), t, par)[1]
        slide_rest = self.slide_motion(q, np.zeros(self.nq), t, par)[1]
        parts = (n, gap_rest + bounce * np.where(w > 0, w, 0.0), d, slide_rest)
        choices: list[list[Any]] = []
        for j in range(len(self.surfaces)):
            held = [STICK, 1, -1] if j in rough else [CLOSED] if j not in self.rubs else [1]
            choices.append([*held, OPEN] if j in touched else [OPEN])
        rails = [[1] for _ in self.rails]  # finite forces have no impulse
        free = mu.copy()
        free[self.rails] = 0.0
        if any(bounce[j] > 0 for j in rough):
            return
        for mode in itertools.product(*choices, *rails):
            f = self.solved(mode, M, M @ v, parts, free)
            if f is not None and self._holds(f, touched, parts, free, np.ones(len(mu), dtype=bool)):
                yield f

    def _poisson(
        self, j: int, M: Array, v: Array, w: float, n: Array, d: Array, sigma: Array, mu: Array,
        e: float,
    ) -> ContactForces:  # fmt: skip
        """Poisson's law of one contact with friction: the rates of the gap and of sliding are
        carried along the normal impulse, piece by piece."""
        k = self.rubs[j]
        inverse = np.linalg.inv(M)
        a_nn, a_nt, a_tt = n[j] @ inverse @ n[j], n[j] @ inverse @ d[k], d[k] @ inverse @ d[k]
        closing, sliding, P, T = float(w), float(sigma[k]), 0.0, 0.0
        goal = np.inf  # normal impulse at which the impact ends, known after compression
        small = 1e-12 * max(abs(closing), abs(sliding))

        def ratio(closing: float, sliding: float) -> float:
            """dT/dP of the friction that acts from here on."""
            if abs(sliding) > small:
                return float(-np.sign(sliding) * mu[k])
            holds = a_nt / a_tt  # d sigma/dP = -a_nt + r a_tt = 0
            if abs(holds) <= mu[k]:
                return float(holds)
            return float(np.sign(holds) * mu[k])

        for _ in range(8):
            r = ratio(closing, sliding)
            slope_n, slope_t = -a_nn + r * a_nt, -a_nt + r * a_tt
            steps = []
            if goal == np.inf and slope_n < 0:
                steps.append((closing / -slope_n, "compressed"))
            if goal < np.inf:
                steps.append((goal - P, "ends"))
            if abs(sliding) > small and sliding * slope_t < 0:
                steps.append((-sliding / slope_t, "stops"))
            if not steps:
                raise ArithmeticError("an impact that does not end")
            step, why = min(steps)
            closing, sliding, P, T = (
                closing + slope_n * step, sliding + slope_t * step, P + step, T + r * step,
            )  # fmt: skip
            if why == "stops":
                sliding = 0.0
            if why == "compressed":
                closing, goal = 0.0, (1 + e) * P
                if e == 0:
                    break
            if why == "ends":
                break
        normal, tangential = np.zeros(len(self.surfaces)), np.zeros(len(self.tangents))
        normal[j], tangential[k] = P, T
        after = v + inverse @ (-P * n[j] + T * d[k])
        return ContactForces(("Poisson",), after, normal, tangential)
