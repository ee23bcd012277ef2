"""Planning in a loop: the rest of a motion from a measured state, again and again."""
