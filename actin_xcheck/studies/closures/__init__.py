"""What the two readings of the moving rim do to ripples, and what mesh refinement makes of it."""
