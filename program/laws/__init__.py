"""The laws that a program is made of: impacts, contacts that last, hits with friction, paths."""
