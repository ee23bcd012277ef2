"""Generated kernels of the model puck_table."""
