"""From a Lagrangian to kernel specifications, with SymPy to model and inspect and SymEngine to
differentiate."""
