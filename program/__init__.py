"""The optimal control problem as a sparse nonlinear program over phases between collisions."""
