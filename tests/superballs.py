"""Discs and balls that tangential restitution sends back."""

import numpy as np
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

x, z, a, u = dynamicsymbols("x z a u")
e_t, k, mu, r = sp.symbols("e_t k mu r")
GRAVITY, RADIUS, HEIGHT = 10.0, 0.1, 0.6
FALL = np.sqrt(2 * GRAVITY * (HEIGHT - RADIUS))
MASS = np.diag([1.0, 1.0, 0.5 * RADIUS**2])
THROWS = [(1, 3), (5, 0), (-5, 10), (0.5, 30)]
LAWS = [(1, 1, 0.05), (0.7, 0.4, 0.3), (0.5, -1, 1), (0.8, 0, 0.05), (0.3, -0.5, 0.3)]  # e, e_t, mu


def disc(**more):
    """A disc (k = 1/2) or ball (k = 2/5) of mass 1 above a floor."""
    fields = {
        "coordinates": [x, z, a],
        "lagrangian": (x.diff() ** 2 + z.diff() ** 2 + k * r**2 * a.diff() ** 2) / 2 - GRAVITY * z,
        "surfaces": {"floor": z >= r},
        "tangents": {"floor": x - r * a},
        "tangential_restitution": {"floor": e_t},
        "parameters": {e_t: 1.0, r: RADIUS, k: 0.5},
    }
    return dmoc.MechanicalSystem("superball", **(fields | more))


def rough(**more):
    parameters = {e_t: 1.0, r: RADIUS, k: 0.5, mu: 0.3}
    return disc(friction={"floor": mu}, parameters=parameters, **more)


def pushed(**more):
    return disc(inputs=[u], forces={x: u}, cost=u**2, **more)


def bounced(velocity, e, back, mu=np.inf, k=0.5):
    """The velocity of a disc after a hit: that of its point is turned round by -back, as far as
    friction can (Garwin 1969; Walton & Braun 1986)."""
    v, fall, w = velocity
    tangential = -(1 + back) * (v - RADIUS * w) / (1 + 1 / k)
    normal = -(1 + e) * fall
    tangential = np.clip(tangential, -mu * normal, mu * normal)
    return np.array([v + tangential, -e * fall, w - tangential / (k * RADIUS)])
