"""A model with its values: masses, forces, momenta, gaps and steps as arrays of mathematical
shapes."""
