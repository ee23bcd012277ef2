"""The methods that can be tried here."""

from __future__ import annotations

from importlib.util import find_spec

from dmoc.solving.methods import METHODS

# All but IPOPT where its package has no wheel yet: `test` leaves it out for the newest Python.
INSTALLED = tuple(
    name
    for name, method in METHODS.items()
    if method.package is None or find_spec(method.package) is not None
)
SPARSE = tuple(name for name in INSTALLED if name != "slsqp")
OWN = tuple(name for name in INSTALLED if METHODS[name].package is None)
