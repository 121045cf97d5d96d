"""Negative controls: deliberate faults, switched on one by one; for each the harness must turn red."""
