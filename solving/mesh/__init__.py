"""One mesh and the next: refinement, its estimate of the error, confirmation."""
