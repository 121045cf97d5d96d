"""From a scene and a method to a stored run, and to many of them."""
