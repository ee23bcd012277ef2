"""The symbolic derivation and the numbers of its kernels, to look at."""
