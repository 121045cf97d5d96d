"""What is worth its work: the Pareto front of error against work, and the advice read off it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from actin_xcheck.core.model import Array

TARGETS = tuple(10.0**-k for k in range(2, 13))
"""Errors advice is given for, as far as they are reached."""


def front(work: Sequence[float] | Array, error: Sequence[float] | Array) -> list[int]:
    """Return the points that no other one beats in both, by increasing work.

    Parameters
    ----------
    work, error : of each point, (n,); those without two finite numbers are left out.

    Of points that are equal in both the first one stands for all.
    """
    order = np.lexsort((np.asarray(error), np.asarray(work)))
    best, kept = math.inf, []
    for i in order.tolist():
        if math.isfinite(work[i]) and error[i] < best:
            best = error[i]
            kept.append(i)
    return kept


@dataclass(frozen=True)
class Advice:
    """The cheapest point for an error: its number among the points charted."""

    error: float
    point: int


def advise(work: Sequence[float] | Array, error: Sequence[float] | Array) -> list[Advice]:
    """Return the cheapest point for each of `TARGETS` that any point reaches, largest error first."""
    kept = front(work, error)
    advice = []
    for target in TARGETS:
        enough = [i for i in kept if error[i] <= target]
        if enough:
            advice.append(Advice(target, enough[0]))
    return advice
