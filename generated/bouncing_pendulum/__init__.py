"""Generated kernels of the model bouncing_pendulum."""
