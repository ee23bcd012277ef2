"""The discretisations there are, as data: polynomials, nodes, quadrature and forms of the inputs of
a step.

A step carries a polynomial of degree d through its d + 1 Lobatto nodes, and integrals over it are
taken at its d Gauss points, which gives order 2 d (S. Ober-Bloebaum, N. Saake: Construction and
analysis of higher order Galerkin variational integrators. Advances in Computational Mathematics 41
(2015) 955-986).

NumPy is imported where it computes: what only shows the table, as ``dmoc --help`` does, starts
without it.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

from dmoc.base.errors import ModelError
from dmoc.base.records import value_class

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]
    Index: TypeAlias = NDArray[np.intp]


@value_class(frozen=True)
class InputForm:
    """How the rows of the inputs u of a phase stand for its steps.

    Row ``stride`` k is the input at the start of step k, ``width`` rows later that at its end; a
    phase with steps has ``shared`` rows more than these need alone.
    """

    name: str
    stride: int
    width: int
    shared: int

    def rows(self, steps: int) -> int:
        """Number of rows of a phase."""
        return self.stride * steps + (self.shared if steps else 0)

    def starts(self, steps: int) -> Index:
        """Row of u at the start of each step of a phase, shape (steps,)."""
        import numpy as np

        return self.stride * np.arange(steps)

    def times(self, t: Array) -> Array:
        """Times that the rows of u of a phase with nodes at t, shape (N + 1,), stand for, shape
        (rows,)."""
        import numpy as np

        times = np.empty(self.rows(len(t) - 1))
        at = self.starts(len(t) - 1)
        times[at], times[at + self.width] = t[:-1], t[1:]
        return times if self.width else (t[:-1] + t[1:]) / 2

    @property
    def jumps(self) -> bool:
        """Whether inputs that vary within a step may jump at its ends."""
        return self.width > 0 and not self.shared


FORMS = {
    form.name: form
    for form in (
        InputForm("constant", stride=1, width=0, shared=0),  # one value a step
        InputForm("linear", stride=1, width=1, shared=1),  # one value a node, linear between them
        InputForm("stages", stride=2, width=1, shared=0),  # linear in a step, two values each
    )
}


@value_class(frozen=True)
class Discretisation:
    """Polynomials of a degree, and the forms of the inputs that go with them, the default first."""

    degree: int
    controls: tuple[str, ...]

    @property
    def order(self) -> int:
        return 2 * self.degree

    @property
    def inside(self) -> int:
        """Number of nodes inside a step."""
        return self.degree - 1

    @property
    def points(self) -> int:
        """Number of quadrature points of a step."""
        return self.degree

    @cached_property
    def nodes(self) -> Array:
        """Places of the nodes in [0, 1]: first, last, inside; shape (degree + 1,)."""
        import numpy as np

        return np.concatenate([[0.0, 1.0], gauss(self.degree - 1, 1)[0]])

    @cached_property
    def places(self) -> Array:
        """Places of the quadrature points in [0, 1], shape (degree,)."""
        return gauss(self.degree)[0]

    @cached_property
    def shapes(self) -> Array:
        """Shape functions of the nodes, shape (degree + 1, degree + 1): row a holds the
        coefficients of 1, x, x^2, ... on [0, 1]."""
        import numpy as np

        return np.asarray(np.linalg.inv(np.vander(self.nodes, increasing=True)).T.copy())

    def slopes(self, places: Array) -> Array:
        """Slopes of the shape functions at some places, shape (n,) in [0, 1], shape (n, degree +
        1)."""
        import numpy as np

        powers, x = np.arange(self.degree + 1), np.asarray(places)[:, None]
        return np.asarray((powers * x ** np.maximum(powers - 1, 0)) @ self.shapes.T)

    @cached_property
    def slopes_of_nodes(self) -> Array:
        """Slopes of the shape functions at the nodes, shape (degree + 1, degree + 1), rows and
        columns in the order of time."""
        import numpy as np

        return self.slopes(np.sort(self.nodes))[:, np.argsort(self.nodes)]

    @cached_property
    def weights(self) -> Array:
        """Weights of the nodes in the order of time, for integrals over [0, 1] (Lobatto
        quadrature), shape (degree + 1,)."""
        import numpy as np

        weights = self.shapes @ (1 / np.arange(1.0, self.degree + 2))
        return np.asarray(weights[np.argsort(self.nodes)])

    @cached_property
    def course(self) -> Array:
        """Polynomials on [0, 1] of which the first ones are one at one node of a step and zero at
        the others, without slopes at its ends, and the last two zero at all nodes with the slope
        one at the start and at the end: column a holds the coefficients of 1, x, x^2, ... of
        polynomial a, shape (degree + 3, degree + 3)."""
        import numpy as np

        powers = np.arange(self.degree + 3)
        rows = np.vander(self.nodes, self.degree + 3, increasing=True)
        slopes = powers * self.nodes[:2, None] ** np.maximum(powers - 1, 0)
        return np.asarray(np.linalg.inv(np.vstack([rows, slopes])))

    def within(self, start: Array, end: Array) -> Array:
        """Values inside each step of quantities linear in it, shape (steps, inside, ...), from
        those at its start and at its end, shape (steps, ...)."""
        import numpy as np

        share = self.nodes[2:].reshape(-1, *(1,) * (np.ndim(start) - 1))
        start, end = np.asarray(start)[:, None], np.asarray(end)[:, None]
        return np.asarray(start + share * (end - start))


def gauss(n: int, a: int = 0) -> tuple[Array, Array]:
    """Places on [0, 1] and weights, whose sum is 1, of Gauss's quadrature with n points for the
    weight (x (1 - x))^a, shape (n,) each. They are found by the eigenvalues of the recurrence of
    Jacobi's polynomials (G. H. Golub and J. H. Welsch, Mathematics of Computation 23 (1969)
    221-230). The places for a = 1 are the nodes inside of Lobatto's n + 2."""
    import numpy as np

    k = np.arange(1.0, n)
    beta = np.sqrt(k * (k + 2 * a) / ((2 * k + 2 * a - 1) * (2 * k + 2 * a + 1)))
    roots, vectors = np.linalg.eigh(np.diag(beta, -1)) if n else (np.zeros(0), np.zeros((1, 0)))
    weights = vectors[0] ** 2
    return (1 + (roots - roots[::-1]) / 2) / 2, (weights + weights[::-1]) / 2


DISCRETISATIONS = {
    d.order: d
    for d in (
        Discretisation(1, ("constant", "linear")),
        Discretisation(2, ("stages", "constant")),
        Discretisation(3, ("stages", "constant")),
    )
}
ORDERS = tuple(DISCRETISATIONS)
ORDERS_SHOWN = ", ".join(map(str, ORDERS))


def known_order(order: int) -> int:
    """The order of a discretisation that there is; raise ModelError for what is none."""
    import numpy as np

    from dmoc.base.arguments import shown

    whole = isinstance(order, (int, np.integer)) and not isinstance(order, bool)
    if not whole or order not in ORDERS:
        raise ModelError(f"order = {shown(order)}: expected one of {ORDERS_SHOWN}.")
    return int(order)
