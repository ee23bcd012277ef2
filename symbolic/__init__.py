"""From a Lagrangian to kernel specifications: SymPy to model and to inspect, a graph of expressions
to differentiate."""
