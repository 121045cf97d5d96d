"""Counted work: what the linear solvers of this process have done since `WORK` was cleared last."""

from collections import Counter

FACTORISATIONS = "factorisations"
"""Matrices factorised, preconditioners among them."""

SOLVES = "solves"
"""Linear systems solved, by whatever means, a right-hand side each."""

ITERATIONS = "iterations"
"""Of conjugate gradients."""

WORK: Counter[str] = Counter()
"""One number by name; whoever measures a run clears it before and reads it after."""
