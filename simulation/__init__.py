"""Motion forward in time: the variational integrator with collisions, the continuous flow, lasting
contact and friction."""
