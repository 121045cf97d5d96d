"""Scenes: the physics of a run, as data, and how it becomes a problem."""
