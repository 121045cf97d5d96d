"""The closures: which way each rim node may move, and what keeps the system solvable.

`prolongation` maps the free unknowns q to nodal vectors, so that the constrained system is P^T L P q = P^T F
and no force acts along the directions left free.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.geometry import Mesh
from actin_xcheck.model import Array, Closure


def rim_directions(closure: Closure, mesh: Mesh, x: Array) -> Array:
    """Unit directions (2, n_rim) in which rim nodes may move; see `Closure` for each reading.

    Parameters
    ----------
    closure : `reference-normal`, `current-normal` or `irrotational-wall`.
    mesh : the reference mesh.
    x : current node positions (2, N).
    """
    rim = mesh.rim_nodes
    match closure:
        case Closure.REFERENCE_NORMAL:
            # the normal of the non-deformed circle (B.7): a rim point keeps to its ray
            direction = mesh.xi[:, rim]
        case Closure.CURRENT_NORMAL:
            # n_i proportional to the integral of phi_i n ds: the chord between the neighbours, turned
            chord = np.roll(x[:, rim], -1, axis=1) - np.roll(x[:, rim], 1, axis=1)
            direction = np.array([chord[1], -chord[0]])
        case Closure.IRROTATIONAL_WALL:
            direction = np.array([-x[1, rim], x[0, rim]])
        case Closure.TRACTION_FREE:
            raise ValueError("a traction-free rim moves freely")
    return direction / np.hypot(*direction)


def prolongation(closure: Closure, mesh: Mesh, x: Array) -> sp.csr_matrix:
    """Sparse map (2 N, n_free) from free unknowns to interleaved nodal vectors."""
    count = mesh.xi.shape[1]
    if closure is Closure.TRACTION_FREE:
        # three pinned unknowns take the rigid motions out; the force balance puts the right ones back
        far = int(mesh.rim_nodes[0])
        centre = int(np.argmin(np.hypot(*mesh.xi)))
        across = 2 * far + int(abs(mesh.xi[0, far]) >= abs(mesh.xi[1, far]))
        free = np.setdiff1d(np.arange(2 * count), [2 * centre, 2 * centre + 1, across])
        return sp.identity(2 * count, format="csr")[:, free]
    rim = mesh.rim_nodes
    direction = rim_directions(closure, mesh, x)
    inside = np.ones(count, dtype=bool)
    inside[rim] = False
    interior = np.flatnonzero(inside)
    rows = np.concatenate([2 * interior, 2 * interior + 1, 2 * rim, 2 * rim + 1])
    columns = np.arange(2 * interior.size)
    tied = 2 * interior.size + np.arange(rim.size)
    values = np.concatenate([np.ones(2 * interior.size), direction[0], direction[1]])
    shape = (2 * count, 2 * interior.size + rim.size)
    return sp.csr_matrix((values, (rows, np.concatenate([columns, tied, tied]))), shape=shape)


def settle(closure: Closure, mesh: Mesh, x: Array) -> Array:
    """Put rim nodes that slid along the wall back onto it; other closures leave positions alone.

    Valid to first order in the amplitude, which is all `irrotational-wall` is for.
    """
    if closure is not Closure.IRROTATIONAL_WALL:
        return x
    rim = mesh.rim_nodes
    settled = x.copy()
    settled[:, rim] *= np.hypot(*mesh.xi[:, rim]) / np.hypot(*x[:, rim])
    return settled


def rigid_motions(x: Array, centre: Array) -> Array:
    """Two translations and the rotation about `centre` (2,), as interleaved vectors (2 N, 3)."""
    motions = np.zeros((2 * x.shape[1], 3))
    motions[0::2, 0] = 1
    motions[1::2, 1] = 1
    motions[0::2, 2] = -(x[1] - centre[1])
    motions[1::2, 2] = x[0] - centre[0]
    return motions
