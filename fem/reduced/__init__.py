"""Smaller models that are exact for a scene: a sector, one ray, linear modes."""
