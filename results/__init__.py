"""What a user gets: solutions, simulations and batches, with their tables, files and reports."""
