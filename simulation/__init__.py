"""Motion forward in time: the variational integrator with collisions, and the independent check
of solutions."""
