"""The whole moving cell with plain scikit-fem: `python skfem_cell.py LAYERS DT FILE.csv`.

Fig. 14 as in (B.23): viscoelastic, rim points on their rays, delta beyond the ring.  P1 for everything, first
order in time, on scikit-fem's own disk, whose sides do not follow the ring.
"""

import csv
import sys

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

PSI, P, D, A_SAT, MU1, MU2, NU, RING, END = 318.067, 0.26, 0.4, 1.4, 2.5, 6.5, 0.3, 0.8, 0.1636
OUTPUTS = 0.05, 0.1, END
P1, P1_VECTOR = ElementTriP1(), ElementVector(ElementTriP1())


def stress(one, two):
    """A stress, of a velocity or a displacement, by its two constants."""
    return BilinearForm(lambda u, w, _: one * ddot(sym_grad(u), sym_grad(w)) + two * div(u) * div(w))


def load(a, phi, delta):
    """Contraction (2.2) and pressure (2.5)."""
    return PSI * a**2 * np.exp(-a / A_SAT) + P / (1 + phi) * (1 + 2 / np.pi * delta * np.arctan(a))


INSIDE = LinearForm(lambda w, q: -load(q.a, div(q.u), q.delta) * div(w))
ON_THE_RIM = LinearForm(lambda w, q: load(q.a, div(q.u), 1.0) * dot(w, q.n))
MASS = BilinearForm(lambda a, w, _: a * w)
DIFFUSION = BilinearForm(lambda a, w, _: D * dot(grad(a), grad(w)))
ONE = LinearForm(lambda w, _: w)


def main(layers: int, dt: float, path: str) -> None:
    """Step to the end and write a row a step."""
    disk = MeshTri.init_circle(layers)
    xi, cells, rim = disk.p, disk.t, disk.boundary_nodes()
    a = 1 + 0.1 * np.abs(np.sin(xi[0]) * np.sin(xi[1]))
    u = np.zeros(2 * xi.shape[1])  # x and y of a node beside each other
    delta = (np.hypot(*xi[:, cells].mean(axis=1)) > RING).astype(float)
    # rim points keep to their rays: one unknown each, along the initial normal
    inner = np.setdiff1d(np.arange(xi.shape[1]), rim)
    free = np.stack([2 * inner, 2 * inner + 1]).ravel()
    normal = (xi[:, rim] / np.hypot(*xi[:, rim])).T.ravel()
    rows = np.concatenate([free, np.stack([2 * rim, 2 * rim + 1], axis=1).ravel()])
    columns = np.concatenate([np.arange(free.size), free.size + np.repeat(np.arange(rim.size), 2)])
    keep = sp.csr_matrix((np.concatenate([np.ones(free.size), normal]), (rows, columns)))

    def here():
        mesh = MeshTri(xi + u.reshape(-1, 2).T, cells)
        return mesh, Basis(mesh, P1), Basis(mesh, P1_VECTOR)

    times = [0.0]
    for end in OUTPUTS:
        times += list(np.linspace(times[-1], end, int(np.ceil((end - times[-1]) / dt - 1e-9)) + 1)[1:])
    mesh, scalar, vector = here()
    mass = MASS.assemble(scalar)
    with open(path, "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time", "area", "total_actin"])
        rows.writerow([0.0, mass.sum(), (mass @ a).sum()])
        for t, step in zip(times[1:], np.diff(times), strict=True):
            facets = FacetBasis(mesh, P1_VECTOR)
            viscous, elastic = (
                stress(*one).assemble(vector) for one in ((MU1, MU2), (1.0, NU / (1 - 2 * NU)))
            )
            force = INSIDE.assemble(
                vector,
                a=scalar.interpolate(a),
                u=vector.interpolate(u),
                delta=vector.with_element(ElementTriP0()).interpolate(delta),
            ) + ON_THE_RIM.assemble(facets, a=FacetBasis(mesh, P1).interpolate(a), u=facets.interpolate(u))
            matrix, right = viscous + step * elastic, viscous @ u + step * force
            made = ONE.assemble(scalar)
            u = keep @ spsolve((keep.T @ matrix @ keep).tocsc(), keep.T @ right)
            before = mass @ a
            mesh, scalar, vector = here()
            mass = MASS.assemble(scalar)
            a = spsolve(((1 + step) * mass + step * DIFFUSION.assemble(scalar)).tocsc(), before + step * made)
            rows.writerow([t, mass.sum(), (mass @ a).sum()])


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]), sys.argv[3])
