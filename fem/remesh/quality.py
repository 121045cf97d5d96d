"""How far cells are from losing their shape, told before one turns over."""

import numpy as np

from actin_xcheck.core.model import Array
from actin_xcheck.core.outcome import COMPLETED, Ending, Outcome
from fem.space import Space

SLIVER = 0.2
"""Shape of a cell below which the mesh is about to break.

An equilateral triangle has it when it is sheared by 2.8; on the article's meshes no cell starts below
0.5.
"""

_TO_EQUILATERAL = np.array([[1, -1 / np.sqrt(3)], [0, 2 / np.sqrt(3)]])
"""Inverse of the map of the reference triangle to the equilateral one with sides of length 1."""


def shapes(space: Space, x: Array) -> Array:
    """Shape of each cell with nodes x (2, N), the worst of its quadrature points, (n_cells,).

    The mean ratio 2 det A / |A|^2 of the map A from an equilateral triangle: 1 where it is one, 0 where an
    angle, the area or one point of a curved cell has none left, negative where it has turned over (Knupp,
    SIAM J. Sci. Comput. 23, 2001).
    """
    tangent_map = space.inside.tangent_map(x)
    (a, b), (c, d) = np.einsum("ijqe,jk->ikqe", tangent_map, _TO_EQUILATERAL)
    ratio = 2 * (a * d - b * c) / (a**2 + b**2 + c**2 + d**2)
    worst: Array = (ratio * space.orientation).min(axis=0)
    return worst


def soundness(space: Space, t: float, x: Array) -> Outcome:
    """`tangled`, with the worst cell, where a mesh is about to fold; the cells are still valid then."""
    of_cells = shapes(space, x)
    worst = int(np.argmin(of_cells))
    if of_cells[worst] > SLIVER:
        return COMPLETED
    started, now = (nodes[:, space.cells[:3, worst]].mean(axis=1) for nodes in (space.xi, x))
    message = (
        f"the mesh is about to fold at t = {t:.6g}: the shape of the cell that started at "
        f"({started[0]:.3f}, {started[1]:.3f}), now at ({now[0]:.3f}, {now[1]:.3f}), has fallen to "
        f"{of_cells[worst]:.2g} of an equilateral triangle's; a run with --remesh would go on"
    )
    return Outcome(Ending.TANGLED, message)
