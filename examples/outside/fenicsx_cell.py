"""The whole moving cell with DOLFINx: `python fenicsx_cell.py LAYERS DT FILE.csv`.

Fig. 14: viscoelastic, rim points on their rays (by a penalty), delta beyond the ring.  P1 on a mesh of rings,
one of which is that of delta; nodes are moved, first order in time.
"""

import csv
import sys

import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem.petsc import assemble_matrix, assemble_vector
from mpi4py import MPI
from petsc4py import PETSc
from ufl import dx, grad, inner

PSI, P, D, A_SAT, MU1, MU2, NU, RING, END = 318.067, 0.26, 0.4, 1.4, 2.5, 6.5, 0.3, 0.8, 0.1636
OUTPUTS, PENALTY = (0.05, 0.1, END), 1e6


def disk(layers: int) -> mesh.Mesh:
    """Rings of 6 k nodes, the one next to delta's moved onto it."""
    radii = np.linspace(0, 1, layers + 1)
    radii = np.interp(radii, [0, round(RING * layers) / layers, 1], [0, RING, 1])
    points, cells, first = [(0.0, 0.0)], [], [0]
    for k in range(1, layers + 1):
        first.append(len(points))
        angles = 2 * np.pi * np.arange(6 * k) / (6 * k)
        points += [(radii[k] * np.cos(one), radii[k] * np.sin(one)) for one in angles]
        for side in range(6):
            for i in range(k):
                outer = [first[k] + (side * k + i + j) % (6 * k) for j in (0, 1)]
                within = [first[k - 1] + (side * (k - 1) + i + j) % max(6 * (k - 1), 1) for j in (-1, 0)]
                cells.append((*outer, within[1]))
                if i:
                    cells.append((outer[0], within[1], within[0]))
    shape = ufl.Mesh(ufl.VectorElement("Lagrange", "triangle", 1))
    return mesh.create_mesh(MPI.COMM_WORLD, np.array(cells), np.array(points), shape)


def solved(form: fem.FormMetaClass, right: PETSc.Vec) -> np.ndarray:
    """The solution of a linear problem on the mesh as it lies now."""
    matrix = assemble_matrix(form)
    matrix.assemble()
    solver, x = PETSc.KSP().create(), right.duplicate()
    solver.setOperators(matrix)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    solver.solve(right, x)
    return x.array


def main(layers: int, dt: float, path: str) -> None:
    """Step to the end and write a row a step."""
    cell = disk(layers)
    space, scalars = fem.VectorFunctionSpace(cell, ("Lagrange", 1)), fem.FunctionSpace(cell, ("Lagrange", 1))
    u, tangent, a = fem.Function(space), fem.Function(space), fem.Function(scalars)
    delta = fem.Function(fem.FunctionSpace(cell, ("DG", 0)))
    delta.interpolate(lambda x: 1.0 * (np.hypot(x[0], x[1]) > RING))
    tangent.interpolate(lambda x: np.array([-x[1], x[0]]) / np.maximum(np.hypot(x[0], x[1]), 1e-9))
    a.interpolate(lambda x: 1 + 0.1 * np.abs(np.sin(x[0]) * np.sin(x[1])))
    (v, w), (b, q) = ((ufl.TrialFunction(one), ufl.TestFunction(one)) for one in (space, scalars))
    x, n, step, ds = ufl.SpatialCoordinate(cell), ufl.FacetNormal(cell), fem.Constant(cell, dt), ufl.ds
    phi = ufl.div(u)

    def load(delta):
        return PSI * a**2 * ufl.exp(-a / A_SAT) + P / (1 + phi) * (1 + 2 / np.pi * delta * ufl.atan(a))

    def stress(one, two, of):
        return one * inner(ufl.sym(grad(of)), ufl.sym(grad(w))) + two * ufl.div(of) * ufl.div(w)

    elastic = NU / (1 - 2 * NU)
    balance = stress(MU1 + step, MU2 + step * elastic, v) * dx
    balance += PENALTY * ufl.dot(v, tangent) * ufl.dot(w, tangent) * ds
    force = -load(delta) * ufl.div(w) * dx - stress(1.0, elastic, u) * dx + load(1.0) * ufl.dot(w, n) * ds
    mechanics, force = fem.form(balance), fem.form(force)
    transport = fem.form((1 + step) * b * q * dx + step * D * inner(grad(b), grad(q)) * dx)
    before, one = fem.form((a + step) * q * dx), fem.Constant(cell, 1.0)
    measured = [fem.form(form * dx(domain=cell)) for form in (one, a, x[0], x[1])]
    nodes, corners = cell.geometry.x.copy(), fem.Function(space)  # which node has which number
    corners.interpolate(lambda x: x[:2])
    number = np.array([np.argmin(np.hypot(*(nodes[:, :2] - at).T)) for at in corners.x.array.reshape(-1, 2)])

    with open(path, "w", newline="") as file:
        rows, t = csv.writer(file), 0.0
        rows.writerow(["time", "area", "total_actin", "centroid_x", "centroid_y"])

        def row():
            area, actin, *moments = (fem.assemble_scalar(form) for form in measured)
            rows.writerow([t, area, actin, *(moment / area for moment in moments)])

        row()
        for end in OUTPUTS:
            steps = int(np.ceil((end - t) / dt - 1e-9))
            step.value, begin = (end - t) / steps, t
            for i in range(1, steps + 1):
                carried = assemble_vector(before)  # here, before the cell moves
                u.x.array[:] += step.value * solved(mechanics, assemble_vector(force))
                cell.geometry.x[number, :2] = nodes[number, :2] + u.x.array.reshape(-1, 2)
                a.x.array[:] = solved(transport, carried)
                t = end if i == steps else begin + i * step.value
                row()


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]), sys.argv[3])
