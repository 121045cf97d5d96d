"""Frontiers: where runs are accurate, where they are silently wrong and where they fail, and of what."""
