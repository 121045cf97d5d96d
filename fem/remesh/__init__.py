"""A mesh that is about to fold, replaced."""
