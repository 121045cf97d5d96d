"""What is measured on curved cells: integrals, material points, orientation."""

import numpy as np

from actin_xcheck.geometry import Indices
from actin_xcheck.model import Array
from actin_xcheck.observables import Measures
from actin_xcheck.result import COMPLETED, Ending, Outcome
from fem.element import lagrange
from fem.space import Space


def measure(space: Space, x: Array, a: Array) -> Measures:
    """Integrals over the cell with nodes x (2, N) and concentrations a (N,), and its rim nodes."""
    sample = space.inside.at(x)
    place, density = (space.inside.blend(nodal[..., space.cells]) for nodal in (x, a))
    area = float(sample.dx.sum())
    centroid = (place * sample.dx).sum(axis=(1, 2)) / area
    return Measures(area, float((density * sample.dx).sum()), centroid, x[:, space.rim_nodes])


def orientation(space: Space, t: float, x: Array) -> Outcome:
    """Check the Jacobian at all quadrature points: `tangled` names the worst cell if one has turned over."""
    areas = space.inside.at(x).dx
    if not np.isfinite(areas).all():
        return Outcome(Ending.NON_FINITE, f"node positions are not finite at t = {t:.6g}")
    worst = int(np.argmin(areas.min(axis=0)))
    if areas[:, worst].min() > 0:
        return COMPLETED
    where = space.xi[:, space.cells[:3, worst]].mean(axis=1)
    message = (
        f"cell {worst}, which started at ({where[0]:.3f}, {where[1]:.3f}), has turned over at one of its "
        f"quadrature points at t = {t:.6g}"
    )
    return Outcome(Ending.TANGLED, message)


def locate(space: Space, points: Array) -> tuple[Indices, Array]:
    """Find material points (2, k): their cells (k,) and the values of the cell's basis there (n_local, k)."""
    found = [_in_some_cell(space, point) for point in points.T]
    cells = np.array([cell for cell, _ in found], dtype=np.int64)
    return cells, np.array([values for _, values in found]).reshape(-1, len(space.cells)).T


def _in_some_cell(space: Space, point: Array) -> tuple[int, Array]:
    """The cell whose map reaches a point (2,) from nearest to its inside, and the basis there (n_local,)."""
    nodes = space.xi[:, space.cells]
    size = np.ptp(nodes, axis=1)
    near = np.abs(nodes.mean(axis=1) - point[:, None]) < size  # its box, doubled
    candidates = np.flatnonzero(near.all(axis=0))
    tried = [_inverted(space, nodes[:, :, cell], point) for cell in candidates]
    cell = int(np.argmin([outside for outside, _ in tried]))
    return int(candidates[cell]), lagrange(space.order).tabulate(tried[cell][1][:, None])[0][:, 0]


def _inverted(space: Space, nodes: Array, point: Array) -> tuple[float, Array]:
    """Newton's method for the reference point (2,) that a cell with nodes (2, n_local) maps to `point`."""
    element, r = lagrange(space.order), np.full(2, 1 / 3)
    for _ in range(30):
        values, slopes = element.tabulate(r[:, None])
        step = np.linalg.solve(nodes @ slopes[..., 0], point - nodes @ values[:, 0])
        r = r + step
        if not np.abs(step).max() > 1e-14:
            break
    outside = max(-r[0], -r[1], r[0] + r[1] - 1, 0.0)
    return (outside if np.isfinite(outside) else np.inf), r
