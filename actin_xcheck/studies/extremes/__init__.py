"""Scenes at the limit of the model, of the mesh and of what can be predicted."""
