"""Sweeps: thousands of runs of one scene over ranges, or of a list of scenes, on one machine or a cluster."""
