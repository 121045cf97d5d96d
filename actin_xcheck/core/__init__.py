"""The equations, meshes and contracts that everything else stands on; nothing here knows a method."""
