"""Motion forward in time: the variational integrator with collisions, lasting contact and friction,
and the independent check of solutions."""
