"""Many starts on a coarse mesh, and the minima that they lead to."""
