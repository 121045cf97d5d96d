"""What theory says a run must do: linear stability on the disk (3.3-3.9, A.1), and growth rates out of runs.

Depends on the model alone; no solver is imported here and no solver imports this.
"""
