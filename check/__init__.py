"""The independent check of a motion: what is measured of it, and the verdict."""
