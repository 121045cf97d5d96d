"""Error against work: every method on meshes and tolerances, each run measured in a process of its own."""
