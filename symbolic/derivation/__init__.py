"""The derivation of a system step by step, as people read it."""
