"""The transport equation in FiPy's words, pulled back to the fixed reference mesh.

With J = V/V0 the conservative Lagrangian form d/dt (V a) = sum_f d S.grad a + k (V - V a) + V s is local
but for its flux.  One implicit step is, on the reference mesh, TransientTerm(J (1 + k dt)) ==
DiffusionTerm(c): what decays stands with the new J a, what is gained with the old one, and face
coefficients c carry the moving faces.  FiPy multiplies with V0/dt and sums fluxes, so mass is exact.  Terms
of its own for decay and gain would say the same and double the cost of assembly.

In time there are two uses.  `system` is (B.23b): backward Euler, with the gain k J of polymerisation from the
old configuration.  Both codes then share one error in dt, and what is left between them is space alone.
`stage` is one implicit stage of a Runge-Kutta method: every term on the configuration of the stage.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.mesh import signed_areas
from actin_xcheck.core.model import Array
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
        self.rate = rate
        mesh = faces.fipy_mesh()
        self.volumes = signed_areas(faces.mesh.xi, faces.mesh.triangles)
        # the old capacity stays 1: the old value of `a` is what the cells start with, per reference area
        self.a = fipy.CellVariable(mesh=mesh, name="a", hasOld=True)
        self.capacity = fipy.CellVariable(mesh=mesh, name="J (1 + k dt)", value=1.0, hasOld=True)
        self.coefficient = fipy.FaceVariable(mesh=mesh, name="c")
        area, distance = faces.geometry(faces.mesh.xi)
        self._reference = np.hypot(*distance) / np.hypot(*area)
        self.equation = fipy.TransientTerm(coeff=self.capacity, var=self.a) == fipy.DiffusionTerm(
            coeff=self.coefficient, var=self.a
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
        gain = self.rate * old_volumes + source * volumes
        return self._assemble(dt, old_volumes * a + dt * gain, volumes, two_point)

    def stage(
        self, dt: float, amounts: Array, volumes: Array, two_point: Array, source: Array
    ) -> tuple[sp.csr_matrix, Array]:
        """Let FiPy assemble V a - dt (k (V - V a) + d L a + V s) = P, all over dt, at the time of a stage.

        Parameters
        ----------
        dt : the diagonal coefficient of the method times its step.
        amounts : what earlier stages leave of actin in each cell, P (n_cells,).
        volumes, two_point, source : as for `system`.
        """
        return self._assemble(dt, amounts + dt * (self.rate + source) * volumes, volumes, two_point)

    def _assemble(
        self, dt: float, amounts: Array, volumes: Array, two_point: Array
    ) -> tuple[sp.csr_matrix, Array]:
        """(1 + k dt) V a - dt d (two-point flux) = amounts, all over dt."""
        self.a.old.setValue(amounts / self.volumes)
        self.capacity.setValue((1 + self.rate * dt) * volumes / self.volumes)
        coefficient = np.zeros(self.faces.nodes.shape[1])
        coefficient[self.faces.interior] = self.d * two_point * self._reference
        self.coefficient.setValue(coefficient)
        self.equation.justResidualVector(dt=dt)
        return self.equation.matrix.matrix, np.asarray(self.equation.RHSvector)
