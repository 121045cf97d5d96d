"""Fields carried from one space on the reference disk to another: read, projected, kept in sum."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.linear import solve
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from fem.fields import locate
from fem.space import Space

CHUNK = 4_000_000
"""Pairs of points and cells that are looked at together."""

NEAR = 1e-8
"""Distance at which a point is hit."""


@dataclass(frozen=True, eq=False)
class Reading:
    """Points in the cells of a space: what reads any of its fields there.

    Attributes
    ----------
    nodes : of the cell at each point, (n_local, q).
    values : the cell's basis functions there, (n_local, q).
    hit : whether the point is in a cell, or as near to one as `NEAR`, (q,).
    """

    nodes: Indices
    values: Array
    hit: NDArray[np.bool_]

    @classmethod
    def at(cls, space: Space, points: Array) -> Self:
        """Read at material points (2, q); one beyond the rim by the width of a chord's arc is read too."""
        size = max(CHUNK // space.cells.shape[1], 1)
        parts = [locate(space, points[:, i : i + size]) for i in range(0, points.shape[1], size)]
        nodes = np.hstack([space.cells[:, cells] for cells, _ in parts])
        values = np.hstack([found for _, found in parts])
        reached = np.einsum("aq,iaq->iq", values, space.xi[:, nodes])
        return cls(nodes, values, np.hypot(*(reached - points)) < NEAR)

    @classmethod
    def at_places(cls, space: Space, x: Array, places: Array) -> Self:
        """Read at places (2, q) where the nodes of the space are at x (2, N)."""
        return cls.at(replace(space, xi=x), places)

    def of(self, field: Array) -> Array:
        """Values (..., q) of a field (..., N)."""
        return np.einsum("aq,...aq->...q", self.values, field[..., self.nodes])


def projected(old: Space, new: Space, x: Array, a: Array, total: float) -> tuple[Array, Outcome]:
    """The concentration a of `old` on `new`, (N,): its L2 projection, in sum `total` to round-off.

    The integrals are those over the cells of `new`, as they lie now; a factor 1 + O(h^(k+1)) puts right what
    they lose of the sum.

    Parameters
    ----------
    old, new : spaces on the same disk.
    x : current node positions of `new`, (2, N).
    a : nodal values on `old`.
    total : of actin, to be kept.
    """
    rule = new.rule(2 * new.order + 1)
    sample = rule.at(x)
    points = rule.blend(new.xi[:, new.cells])
    density = Reading.at(old, points.reshape(2, -1)).of(a).reshape(points.shape[1:])
    mass = new.scalars.matrix(new.inside.at(x).mass())
    found, outcome = solve(mass, new.scalars.vector(sample.load(density)))
    return found * (total / (mass @ found).sum()), outcome
