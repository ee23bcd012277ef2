"""The way from a problem to its solution: programs, starts, a method, the judge, the check,
meshes."""
