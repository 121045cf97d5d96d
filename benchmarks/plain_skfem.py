"""The article's scheme (B.23) as one would write it with scikit-fem alone: new mesh, new bases, `spsolve`.

Kept to be measured against: `step` is one step of Fig. 14's cell (viscoelastic, ring, rim on its rays).
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP0,
    ElementTriP1,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshTri,
)
from skfem.helpers import ddot, div, dot, grad, sym_grad

PSI, P, D, A_SAT, MU1, MU2, NU_PRIME = 318.067, 0.26, 0.4, 1.4, 2.5, 6.5, 0.75


def active(a, phi, delta):
    """The contractile and the pressure stress, (2.2) and (2.5)."""
    return PSI * a**2 * np.exp(-a / A_SAT) + P / (1 + phi) * (1 + 2 / np.pi * delta * np.arctan(a))


@BilinearForm
def viscous(v, w, _):
    """A of (B.21)."""
    return MU1 * ddot(sym_grad(v), sym_grad(w)) + MU2 * div(v) * div(w)


@BilinearForm
def elastic(u, w, _):
    """B of (B.21)."""
    return ddot(sym_grad(u), sym_grad(w)) + NU_PRIME * div(u) * div(w)


@LinearForm
def load(w, fields):
    """-f div w inside."""
    return -active(fields.a, div(fields.u), fields.delta) * div(w)


@LinearForm
def rim_load(w, fields):
    """f w.n on the rim."""
    return active(fields.a, div(fields.u), 1.0) * dot(w, fields.n)


@BilinearForm
def mass(a, w, _):
    """M of (B.22)."""
    return a * w


@BilinearForm
def stiffness(a, w, _):
    """K of (B.22)."""
    return dot(grad(a), grad(w))


def start(mesh):
    """Positions and concentration at t = 0 on a `geometry.disk`."""
    x, y = mesh.xi
    return mesh.xi.copy(), 1 + 0.1 * np.abs(np.sin(x) * np.sin(y))


def step(mesh, x, a, dt):
    """One step of (B.23): new positions (2, N) and concentration (N,)."""
    moved = MeshTri(x, mesh.triangles.astype(np.int32))
    vector = Basis(moved, ElementVector(ElementTriP1()), intorder=2)
    scalar, constant = vector.with_element(ElementTriP1()), vector.with_element(ElementTriP0())
    rim = FacetBasis(moved, ElementVector(ElementTriP1()), intorder=3)
    u = (x - mesh.xi).T.ravel()
    delta = (np.hypot(*mesh.xi[:, mesh.triangles].mean(axis=1)) > 0.8).astype(float)
    inside = {"a": scalar.interpolate(a), "u": vector.interpolate(u), "delta": constant.interpolate(delta)}
    on_rim = {"a": rim.with_element(ElementTriP1()).interpolate(a), "u": rim.interpolate(u)}
    b = elastic.assemble(vector)
    left = viscous.assemble(vector) + dt * b
    right = load.assemble(vector, **inside) + rim_load.assemble(rim, **on_rim) - b @ u
    free = rays(mesh)
    v = free @ spsolve((free.T @ left @ free).tocsc(), free.T @ right)
    new = x + dt * v.reshape(-1, 2).T
    after = Basis(MeshTri(new, mesh.triangles.astype(np.int32)), ElementTriP1(), intorder=2)
    matrix = (1 + dt) * mass.assemble(after) + dt * D * stiffness.assemble(after)
    return new, spsolve(matrix.tocsc(), mass.assemble(scalar) @ (a + dt))


def rays(mesh):
    """Each rim node keeps to its ray: sparse map (2 N, n_free) from free unknowns to nodal vectors."""
    count, rim = mesh.xi.shape[1], mesh.rim_nodes
    interior = np.setdiff1d(np.arange(count), rim)
    direction = mesh.xi[:, rim] / np.hypot(*mesh.xi[:, rim])
    inner, tied = np.arange(2 * interior.size), 2 * interior.size + np.arange(rim.size)
    rows = np.concatenate([2 * interior, 2 * interior + 1, 2 * rim, 2 * rim + 1])
    columns = np.concatenate([inner, tied, tied])
    values = np.concatenate([np.ones(inner.size), *direction])
    return sp.csr_matrix((values, (rows, columns)), (2 * count, tied[-1] + 1))
