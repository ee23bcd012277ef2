"""What is proved of answers, with rounding errors counted."""
