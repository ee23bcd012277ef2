"""From kernel specifications to compiled kernels; nothing here knows mechanics."""
