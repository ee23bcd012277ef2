"""Drivers for the nonlinear program: one interface, one set of statuses."""
