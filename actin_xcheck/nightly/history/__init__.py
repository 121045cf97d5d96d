"""Every number of every night in one file, and what changed when."""
