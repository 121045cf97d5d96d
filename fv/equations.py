"""The transport equation in FiPy's words, pulled back to the fixed reference mesh.

With J = V/V0 the conservative Lagrangian form d/dt (V a) = sum_f d S.grad a + k (V - V a) + V s reads, on the
reference mesh, TransientTerm(J) == DiffusionTerm(c) + k J (1 - a) + J s; FiPy multiplies J.old with a.old, so
mass is exact.  Face coefficients c carry the moving faces.  In time it is (B.23b): backward Euler, with the
gain k J of polymerisation from the old configuration.  Both codes then share one error in dt, and what is
left between them is space alone.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.geometry import signed_areas
from actin_xcheck.model import Array
from fv.mesh import Faces, fipy


class TransportEquation:
    """FiPy's mesh, variables and terms, built once; a step fills in numbers.

    Parameters
    ----------
    faces : the mesh's faces.
    d : diffusion coefficient.
    rate : reaction rate k, 1 or 0.
    """

    def __init__(self, faces: Faces, d: float, rate: float) -> None:
        self.faces = faces
        self.d = d
        mesh = faces.fipy_mesh()
        self.volumes = signed_areas(faces.mesh.xi, faces.mesh.triangles)
        self.a = fipy.CellVariable(mesh=mesh, name="a", hasOld=True)
        self.dilution = fipy.CellVariable(mesh=mesh, name="J", value=1.0, hasOld=True)
        self.gain = fipy.CellVariable(mesh=mesh, name="k J + J s")
        self.coefficient = fipy.FaceVariable(mesh=mesh, name="c")
        area, distance = faces.geometry(faces.mesh.xi)
        self._reference = np.hypot(*distance) / np.hypot(*area)
        self.rate = rate
        self.equation = fipy.TransientTerm(coeff=self.dilution, var=self.a) == (
            fipy.DiffusionTerm(coeff=self.coefficient, var=self.a)
            - fipy.ImplicitSourceTerm(coeff=rate * self.dilution, var=self.a)
            + self.gain
        )
        self.equation.cacheMatrix()
        self.equation.cacheRHSvector()

    def system(
        self, dt: float, a: Array, old_volumes: Array, volumes: Array, two_point: Array, source: Array
    ) -> tuple[sp.csr_matrix, Array]:
        """Let FiPy assemble one backward Euler step.

        Parameters
        ----------
        dt : the step.
        a : cell averages before the step, (n_cells,).
        old_volumes, volumes : cell areas before and after the step, (n_cells,).
        two_point : coefficients of (a_second - a_first) at the interior faces, per unit of d, (n_interior,).
        source : cell averages of the source term after the step, (n_cells,).

        Returns
        -------
        FiPy's matrix and right-hand side.
        """
        self.a.setValue(a)
        self.a.updateOld()
        self.dilution.setValue(old_volumes / self.volumes)
        self.dilution.updateOld()
        self.dilution.setValue(volumes / self.volumes)
        self.gain.setValue((self.rate * old_volumes + source * volumes) / self.volumes)
        coefficient = np.zeros(self.faces.nodes.shape[1])
        coefficient[self.faces.interior] = self.d * two_point * self._reference
        self.coefficient.setValue(coefficient)
        self.equation.justResidualVector(dt=dt)
        return self.equation.matrix.matrix, np.asarray(self.equation.RHSvector)
