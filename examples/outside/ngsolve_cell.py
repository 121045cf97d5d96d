"""The whole moving cell with NGSolve: `python ngsolve_cell.py H DT FILE.csv`.

Fig. 14: viscoelastic, rim points on their rays (by a penalty), delta beyond the ring.  Curved elements of
degree 2 whose sides follow the ring, first order in time.
"""

import csv
import sys

import numpy as np
from netgen.geom2d import SplineGeometry
from ngsolve import (
    CF,
    H1,
    BilinearForm,
    Grad,
    GridFunction,
    InnerProduct,
    Integrate,
    LinearForm,
    Mesh,
    Sym,
    VectorH1,
    atan,
    div,
    ds,
    dx,
    exp,
    grad,
    sin,
    specialcf,
    sqrt,
    x,
    y,
)

PSI, P, D, A_SAT, MU1, MU2, NU, RING, END = 318.067, 0.26, 0.4, 1.4, 2.5, 6.5, 0.3, 0.8, 0.1636
OUTPUTS, PENALTY = (0.05, 0.1, END), 1e7


def disk(h: float) -> Mesh:
    """Triangles of about h, whose sides follow the ring."""
    circles = SplineGeometry()
    circles.AddCircle((0, 0), 1, leftdomain=1, rightdomain=0, bc="rim")
    circles.AddCircle((0, 0), RING, leftdomain=2, rightdomain=1, bc="ring")
    circles.SetMaterial(1, "outer")
    circles.SetMaterial(2, "inner")
    mesh = Mesh(circles.GenerateMesh(maxh=h))
    mesh.Curve(2)
    return mesh


def main(h: float, dt: float, path: str) -> None:
    """Step to the end and write a row a step."""
    mesh = disk(h)
    space, scalars = VectorH1(mesh, order=2), H1(mesh, order=2)
    (v, w), (b, q) = space.TnT(), scalars.TnT()
    u, tangent, a = GridFunction(space), GridFunction(space), GridFunction(scalars)
    tangent.Set(CF((-y, x)), definedon=mesh.Boundaries("rim"))
    product = sin(x) * sin(y)
    a.Set(1 + 0.1 * sqrt(product * product))
    delta, n, phi = mesh.MaterialCF({"outer": 1.0, "inner": 0.0}), specialcf.normal(2), div(u)

    def load(delta):
        return PSI * a * a * exp(-a / A_SAT) + P / (1 + phi) * (1 + 2 / np.pi * delta * atan(a))

    def stress(one, two, of):
        return one * InnerProduct(Sym(Grad(of)), Sym(Grad(w))) + two * div(of) * div(w)

    with open(path, "w", newline="") as file:
        rows, t = csv.writer(file), 0.0
        rows.writerow(["time", "area", "total_actin", "centroid_x", "centroid_y"])

        def row():
            area = Integrate(CF(1.0), mesh)
            rows.writerow([t, area, Integrate(a, mesh), *(Integrate(one, mesh) / area for one in (x, y))])

        row()
        for end in OUTPUTS:
            steps = int(np.ceil((end - t) / dt - 1e-9))
            step, begin = (end - t) / steps, t
            for number in range(1, steps + 1):
                force = LinearForm(space)
                force += -load(delta) * div(w) * dx - stress(1.0, NU / (1 - 2 * NU), u) * dx
                force += load(1.0) * InnerProduct(w, n) * ds("rim", skeleton=True)
                matrix = BilinearForm(space, symmetric=True)
                matrix += stress(MU1 + step, MU2 + step * NU / (1 - 2 * NU), v) * dx
                matrix += PENALTY * InnerProduct(v, tangent) * InnerProduct(w, tangent) * ds("rim")
                before = LinearForm((a + step) * q * dx).Assemble()  # here, before the cell moves
                matrix.Assemble()
                force.Assemble()
                u.vec.data += step * matrix.mat.Inverse(space.FreeDofs(), "sparsecholesky") * force.vec
                mesh.SetDeformation(u)
                carried = BilinearForm((1 + step) * b * q * dx + step * D * grad(b) * grad(q) * dx).Assemble()
                a.vec.data = carried.mat.Inverse(scalars.FreeDofs(), "sparsecholesky") * before.vec
                t = end if number == steps else begin + number * step
                row()


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]), sys.argv[3])
