"""Solvers to carry away: a problem as C sources that need neither Python nor a heap."""
