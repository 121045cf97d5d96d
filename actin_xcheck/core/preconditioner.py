"""The inverse of a matrix in single precision, of its factor by fronts: conjugate gradients are given it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dpotri

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array


@dataclass(frozen=True, eq=False)
class Front:
    """Unknowns eliminated together, and where their dense matrix gets its numbers.

    Attributes
    ----------
    pivots : range of the unknowns eliminated here, in elimination order.
    boundary : later unknowns coupled to them, (m - p,); m rows in all, p of them pivots.
    place, source : entry `source` of the sparse matrix goes to `place` in the flattened front.
    children : fronts whose Schur complements are added, each with its pieces (rows, columns, rows of the
        child, columns of the child); only the upper triangle is ever read.
    """

    pivots: slice
    boundary: Indices
    place: Indices
    source: Indices
    children: list[tuple[int, list[tuple[slice, slice, slice, slice]]]]


class Preconditioner:
    """The inverse of one matrix in single precision: a factor laid out for speed, applied to many vectors.

    Fronts of one generation are independent of each other; those of nearly one size are padded to one and
    substituted by one product each way.  Of A = [[A_pp, A_pb], [A_bp, A_bb]] a front keeps S = A_pp^-1 and
    C = A_bp S: forwards b - C p goes to the boundary, backwards p becomes S p - C^T b.

    Parameters
    ----------
    order : unknowns in order of elimination, (n,).
    fronts : of the factorisation.
    blocks : L by fronts, (pivots; boundary).
    """

    def __init__(self, order: Indices, fronts: list[Front], blocks: Iterator[tuple[Array, Array]]) -> None:
        self._order = order
        self._groups = _groups(fronts, order.size)
        place = {
            number: (g, i) for g, group in enumerate(self._groups) for i, number in enumerate(group.fronts)
        }
        for number, (diagonal, below) in enumerate(blocks):
            group, i = self._groups[place[number][0]], place[number][1]
            pivots, size = diagonal.shape[0], below.shape[0]
            group.inverse[i, :pivots, :pivots] = dpotri(diagonal, lower=1)[0]  # its lower triangle
            group.coupling[i, :size, :pivots] = dtrsm(1.0, diagonal, below, side=1, lower=1)
        for group in self._groups:
            lower = np.tril(group.inverse)
            group.inverse[:] = lower + np.tril(lower, -1).swapaxes(1, 2)

    def __call__(self, vector: Array) -> Array:
        """The inverse applied to a vector (n,)."""
        scale = np.abs(vector).max()  # keeps small residuals out of single precision's underflow
        x = np.zeros(vector.size + 1, dtype=np.float32)  # the last one is where padding points
        x[:-1] = vector[self._order] / scale
        for group in self._groups[:-1]:  # the last one has no boundary
            np.subtract.at(x, group.boundary.ravel(), (group.coupling @ x[group.pivots]).ravel())
        x[-1] = 0
        for group in reversed(self._groups):
            own = group.inverse @ x[group.pivots]
            if group.boundary.size:
                own -= group.coupling.swapaxes(1, 2) @ x[group.boundary]
            x[group.pivots] = own
        solution = np.empty_like(vector)
        solution[self._order] = x[:-1]
        return solution * scale


@dataclass(frozen=True, eq=False)
class _Group:
    """Fronts of one generation, padded to p pivots and m boundary unknowns; padding is unknown n.

    Attributes
    ----------
    fronts : their numbers, (f,).
    pivots, boundary : their unknowns, (f, p, 1) and (f, m, 1).
    inverse, coupling : S (f, p, p) and C (f, m, p) of each.
    """

    fronts: list[int]
    pivots: Indices
    boundary: Indices
    inverse: NDArray[np.float32]
    coupling: NDArray[np.float32]


PADDING = 1.3
"""Largest share of a group's numbers, padding included, in those of its fronts."""


def _groups(fronts: list[Front], size: int) -> list[_Group]:
    """Sort fronts into groups, generation by generation from the leaves."""
    generation = np.zeros(len(fronts), dtype=np.int64)
    for number, front in enumerate(fronts):
        generation[number] = 1 + max((generation[child] for child, _ in front.children), default=-1)
    shapes = [(front.pivots.stop - front.pivots.start, front.boundary.size) for front in fronts]
    order = sorted(range(len(fronts)), key=lambda number: (generation[number], *shapes[number]))
    groups: list[list[int]] = []
    p = m = kept = 0
    for number in order:
        wide, high = max(p, shapes[number][0]), max(m, shapes[number][1])
        own = shapes[number][0] * sum(shapes[number])
        alike = groups and generation[groups[-1][0]] == generation[number]
        if alike and (len(groups[-1]) + 1) * wide * (wide + high) <= PADDING * (kept + own):
            groups[-1].append(number)
            p, m, kept = wide, high, kept + own
        else:
            groups.append([number])
            p, m, kept = *shapes[number], own
    return [_group(fronts, numbers, size) for numbers in groups]


def _group(fronts: list[Front], numbers: list[int], padding: int) -> _Group:
    p = max(fronts[number].pivots.stop - fronts[number].pivots.start for number in numbers)
    m = max(fronts[number].boundary.size for number in numbers)
    pivots, boundary = (np.full((len(numbers), length, 1), padding) for length in (p, m))
    for i, front in enumerate(fronts[number] for number in numbers):
        pivots[i, : front.pivots.stop - front.pivots.start, 0] = np.arange(
            front.pivots.start, front.pivots.stop
        )
        boundary[i, : front.boundary.size, 0] = front.boundary
    inverse, coupling = (np.zeros((len(numbers), length, p), dtype=np.float32) for length in (p, m))
    return _Group(numbers, pivots, boundary, inverse, coupling)
