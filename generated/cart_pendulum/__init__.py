"""Generated kernels of the model cart_pendulum."""
