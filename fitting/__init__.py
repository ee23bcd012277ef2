"""dmoc.fit: parameters of a model from measured motions."""
