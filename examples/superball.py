r"""Superball under a table
=======================

With which spin must a superball be thrown under a table to come back into the hand?

It hits the floor, the underside of the table and the floor. A hit turns the velocity :math:`\sigma`
of its touching point round, by a tangential impulse. For a solid ball of radius :math:`r`, with
:math:`\sigma = \dot x - r \omega` at the floor and :math:`\dot x + r \omega` at the table,

.. math::

   \sigma^+ = -\sigma^-, \qquad
   \dot x^+ = \dot x^- - \frac{4}{7}\, \sigma^-, \qquad
   r \omega^+ = r \omega^- \pm \frac{10}{7}\, \sigma^- ,

so that the energy is kept. Where the table turns round both :math:`\dot x` and :math:`\omega`, the
ball goes back the way that it came: :math:`r \omega_1 = \frac{5}{2} \dot x_1` before that hit, and

.. math::

   \omega_0 = \frac{5\, \dot x_0}{26\, r}

at the throw, whatever the heights. R. L. Garwin, *Kinematics of an ultraelastic rough
ball*, American Journal of Physics 37 (1969) 88-92, and :eq:`tangential` of the :doc:`theory
</theory>`.

Run:  ``python examples/superball.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

RADIUS, TABLE, HAND, GRAVITY = 0.03, 0.75, 0.5, 9.81
AHEAD, FALL = 3.0, -6.0  # the throw, in m/s

SPIN = 5 * AHEAD / (26 * RADIUS)  # rad/s


# %%
# The model
# ---------
# Of each surface the model has the gap, the tangential position of the touching point, and the
# coefficient of tangential restitution: 1 turns the point round.


def system() -> dmoc.MechanicalSystem:
    x, z, a = dynamicsymbols("x z a")
    r, h, g, e_t = sp.symbols("r h g e_t")
    rates = x.diff() ** 2 + z.diff() ** 2 + sp.Rational(2, 5) * r**2 * a.diff() ** 2
    rim = (x + r * sp.cos(a), z - r * sp.sin(a))
    return dmoc.MechanicalSystem(
        "superball",
        coordinates=[x, z, a],
        lagrangian=rates / 2 - g * z,
        surfaces={"floor": z >= r, "table": z <= h - r},
        tangents={"floor": x - r * a, "table": x + r * a},
        tangential_restitution={"floor": e_t, "table": e_t},
        parameters={r: RADIUS, h: TABLE, g: GRAVITY, e_t: 1.0},
        units={x: "m", z: "m", a: "rad"},
        drawing=[
            dmoc.Wall((-0.1, 0), (0.45, 0)),
            dmoc.Wall((0.45, h), (0.02, h)),
            dmoc.Disc((x, z), r),
            dmoc.Link((x, z), rim),
            dmoc.Contact("floor", (x, z - r)),
            dmoc.Contact("table", (x, z + r)),
        ],
    )


# %%
# The problem
# -----------
# The spin at the start is a range, of all else of the throw there is a number. It is caught at the
# height at which it was thrown.


def problem(steps: int = 10) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system()),
        start={"x": 0, "z": HAND, "a": 0, "x_dot": AHEAD, "z_dot": FALL, "a_dot": (-200, 200)},
        goal={"x": 0, "z": HAND},
        sequence=["floor", "table", "floor"],
        steps=steps,
        final_time=(0.1, 1.0),
    )


# %%
# The answer
# ----------
# One solve gives the spin. The energies before and after the three hits are the same.


def main() -> None:
    solution = dmoc.solve(problem(), "ipm")
    first, last = solution.phases[0].v[0], solution.phases[-1].v[-1]
    masses = (1, 1, 0.4 * RADIUS**2)
    energies = [sum(m * s**2 / 2 for m, s in zip(masses, v, strict=True)) for v in (first, last)]
    rows = [
        ("spin of the throw", first[2], SPIN),
        ("energy that comes back", energies[1], energies[0]),
    ]
    show("superball", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The second half of the motion is the first one backwards. Spin and energies agree to rounding,
# because flights are exact and a hit with tangential restitution is stated in the velocities beside
# it. A worn ball needs another spin, and comes back another way: with
# ``problem().but(parameters={"e_t": 0.6})`` it is -89.9 rad/s.
