"""The force balance (3.2) by finite volumes, as a Mechanics: cells' velocities balance, vertices follow.

Unknown are the velocities of the cells and of the faces on the rim.  Each cell's tractions and active stress
balance; so do those on a rim face, as far as its closure lets it move:

    sum_f (sigma_v + sigma_e + f I) S = 0 in a cell,    (sigma_v + sigma_e + f I) S = f_rim S on the rim.

Gradients are those of `stress.py`.  Vertex velocities are interpolated from the places around, exactly for
linear fields, and move the mesh; displacements u = x - xi are known at the vertices, so that the elastic
stress and the dilation are known too.

Where delta jumps, f does, and so does the velocity's normal derivative.  Continuity of the traction makes of
the two sides' f its mean, weighted by the places' distances, in the face's balance; it also says what the
jump of the derivative is, which the interpolation at the ring's vertices takes out of the outer values.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from actin_xcheck.core.contract import NOTHING, Move
from actin_xcheck.core.errors import COMPLETED, Outcome
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array, Closure, Model, Rheology
from actin_xcheck.core.motion import Anchor
from fv import krylov
from fv.boundary import Ties, settle
from fv.mesh import Faces
from fv.rim import RimFaces
from fv.stress import Assembly, Diamonds, Moduli, divergence, normal_derivative, traction
from fv.system import System


@dataclass(frozen=True, eq=False)
class _Loads:
    """What is known before velocities are.

    Attributes
    ----------
    on_faces : (sigma_e + f I) S, (2, n_faces).
    elastic : of on_faces, sigma_e S.
    on_rim : f S outside of the boundary's faces, and the wall's friction, (2, n_boundary).
    jump : of the velocity's normal derivative across the ring's faces, (2, n_ring).
    dilation : the smallest one that the pressure sees around each cell, (n_cells,).
    """

    on_faces: Array
    elastic: Array
    on_rim: Array
    jump: Array
    dilation: Array


@dataclass(frozen=True)
class PlacesMove(Move):
    """A `Move` with the velocities found at the places, (2 n_places,)."""

    at_places: Array = field(default_factory=lambda: NOTHING)


class FvForceBalance:
    """Cell-centred force balance on the current configuration; see this module.

    Parameters
    ----------
    model : constitutive laws, rheology, closure and delta.
    mesh : the reference mesh; displacements are u = x - xi.
    """

    def __init__(self, model: Model, mesh: Mesh) -> None:
        self.model, self.mesh = model, mesh
        self.faces = faces = Faces.of(mesh)
        self.delta = model.delta_on_cells(mesh.centroids)
        self.ties = Ties(model.closure, faces)
        self.assembly = Assembly(faces, self.ties.unknown, self.ties.size)
        first, second = faces.cells[:, faces.interior]
        self.ring = faces.interior[self.delta[first] != self.delta[second]]
        self._anchor, self._guess = Anchor(mesh.xi), np.zeros(2 * self.ties.places)
        self.free_rim = RimFaces(model, faces, self.ties.on_rim) if model.rim_sees_dilation else None

    def start(self, x: Array) -> Array:
        """Initial positions (2, N), with the rim where the closure wants it."""
        return self.settle(x)

    def settle(self, x: Array) -> Array:
        """Put rim vertices back onto the wall of `irrotational-wall`."""
        return settle(self.model.closure, self.faces, x)

    def advance(self, t: float, dt: float, x: Array, corners: Array) -> PlacesMove:
        """Move the vertices from x (2, N) at t, elastic stress implicit as in (B.23a)."""
        move = self._move(t, dt, x, corners)
        return replace(move, x=self.settle(x + dt * move.v)) if move.outcome.ok else move

    def velocity(self, t: float, x: Array, corners: Array) -> Array:
        """The instantaneous vertex velocities (2, N)."""
        return self.flow(t, x, corners).v

    def carried(self, u0: Callable[[Array], Array]) -> Array:
        """F N on a free rim whose load sees the dilation, (2, n_rim); see `rim.py`."""
        return NOTHING if self.free_rim is None else self.free_rim.start(u0)

    def flow(self, t: float, x: Array, corners: Array, carried: Array = NOTHING) -> PlacesMove:
        """The same as a Move that leaves the vertices at x, with its Outcome and the gauge's loads.

        Without what is carried the rim's load takes the dilation beside it.
        """
        return self._move(t, 0.0, x, corners, carried)

    def moduli(self, dt: float) -> Moduli:
        """Of the stress of velocities within a step: viscous, and dt times the elastic ones."""
        (mu1, mu2), (one, nu_prime) = self.model.viscous_moduli(), self.model.elastic_moduli()
        return mu1 + dt * one, mu2 + dt * nu_prime

    def displacement(self, x: Array) -> Array:
        """The displacement the elastic stress and the dilation see (Remark 2.1), (2, N)."""
        return x - self.mesh.xi if self.model.rheology is Rheology.VISCOELASTIC else np.zeros_like(x)

    def near(self, anchor: Anchor, guess: Array | None) -> Self:
        """Return the same, its systems preconditioned at an anchor, solutions sought near a guess at places.

        Without a guess (2 n_places,) they are sought near zero.
        """
        other = copy(self)
        other._anchor = anchor
        if guess is not None:
            other._guess = guess
        return other

    def _move(self, t: float, dt: float, x: Array, corners: Array, carried: Array = NOTHING) -> PlacesMove:
        """The velocities at x (2, N), where the vertices stay."""
        diamonds, moduli = Diamonds.at(self.faces, x), self.moduli(dt)
        rim = self.free_rim if carried.size else None
        rim_dilation = None if rim is None else rim.dilation(x, carried)
        loads = self.loads(diamonds, x, corners, moduli, rim_dilation)
        outcome = self.model.dilated(t, loads.dilation, self._place)
        if not outcome.ok:
            return PlacesMove(x, np.zeros_like(x), outcome)
        system = System(self.ties, self.assembly, diamonds, x, moduli)
        kink = self._kink(diamonds, x, system.interpolation, loads.jump)
        load = self.assembly.load(loads.on_faces)
        load[:, -self.faces.rim.size :] += loads.on_rim
        load = load.T.ravel() - system.from_vertices(system.projected(kink))
        found, outcome = system.solve(load, self._guess, self._factor)
        moved = system.at_vertices(found) + system.projected(kink)
        v = system.without_rigid_motion(moved)
        rate = NOTHING
        if rim is not None:
            viscous = traction(diamonds.gradient(found.reshape(-1, 2).T, moved), diamonds.area, moduli)
            rate = rim.rate(x, v, carried, (viscous + loads.elastic)[:, rim.faces])
        return PlacesMove(x, v, outcome, *system.net(found), carried=rate, at_places=found)

    def _factor(self) -> krylov.Inverse | None:
        """Of the two-point part at the anchor."""
        x = self._anchor.x

        def made() -> krylov.Inverse | None:
            diamonds = Diamonds.at(self.faces, x)
            return System(self.ties, self.assembly, diamonds, x, self.moduli(0.0)).factor()

        return self._anchor.factor("force balance", made)

    def loads(
        self,
        diamonds: Diamonds,
        x: Array,
        corners: Array,
        moduli: Moduli,
        rim_dilation: Array | None = None,
    ) -> _Loads:
        """Elastic and active tractions at x (2, N) under corner values (3, n_cells).

        The dilation on the rim (n_rim,) is that beside it where it is not known better.
        """
        faces, model, u = self.faces, self.model, self.displacement(x)
        area, ring = diamonds.area, self.ring
        a = corners.T.ravel()[faces.ends].mean(axis=(0, 1))
        at_places = self._at_places(u)
        gradient = diamonds.gradient(at_places, u)
        elastic = traction(gradient, area, model.elastic_moduli())
        own = _gradients(x, self.mesh, u)
        phi = self._seen(gradient, own, rim_dilation)
        first, second = faces.cells[0], np.where(faces.cells[1] < 0, faces.cells[0], faces.cells[1])
        f = model.active_stress(a, phi, self.delta[np.stack([first, second])])
        middle = diamonds.places[:, first] - x[:, faces.nodes].mean(axis=1)
        share = -(middle * area).sum(axis=0) / diamonds.reach  # of the first side in D.S; 1 on the rim
        mean = share * f[0] + (1 - share) * f[1]
        own_elastic = [
            traction(own[:, :, cells[ring]], area[:, ring], model.elastic_moduli())
            for cells in (first, second)
        ]
        length = np.hypot(*area[:, ring])
        across = (f[1] - f[0])[ring] * area[:, ring] + own_elastic[1] - own_elastic[0]
        return _Loads(
            on_faces=mean * area + elastic,
            elastic=elastic,
            on_rim=self._on_rim(area, a, phi[0], at_places[:, -faces.rim.size :]),
            jump=-normal_derivative(across / length, area[:, ring] / length, moduli),
            dilation=self._least(phi),
        )

    def intact(self, t: float, x: Array, carried: Array = NOTHING) -> Outcome:
        """Whether the pressure exists where a step has led, at x (2, N) with what is carried."""
        if not self.model.breaks_down:
            return COMPLETED
        rim, u = self.free_rim if carried.size else None, self.displacement(x)
        gradient = Diamonds.at(self.faces, x).gradient(self._at_places(u), u)
        rim_dilation = None if rim is None else rim.dilation(x, carried)
        seen = self._seen(gradient, _gradients(x, self.mesh, u), rim_dilation)
        return self.model.dilated(t, self._least(seen), self._place)

    def _seen(self, gradient: Array, own: Array, rim_dilation: Array | None) -> Array:
        """The dilation (2, n_faces) that the pressure sees on both sides of faces.

        It is that of the faces' gradients, but of the cells' own ones on the ring, and on the rim that known
        better where it is, (n_rim,).
        """
        phi = divergence(gradient)
        if self.free_rim is not None and rim_dilation is not None:
            phi[self.free_rim.faces] = rim_dilation
        seen = np.stack([phi, phi])
        seen[:, self.ring] = divergence(own)[self.faces.cells[:, self.ring]]
        return seen

    def _at_places(self, nodal: Array) -> Array:
        """Means (2, n_places) over the cells and the boundary's faces of vertex values (2, N)."""
        ends = self.faces.nodes[:, self.faces.rim]
        return np.hstack([nodal[:, self.mesh.triangles].mean(axis=1), nodal[:, ends].mean(axis=1)])

    def _on_rim(self, area: Array, a: Array, phi: Array, u: Array) -> Array:
        """f_rim S on the rim, less the wall's elastic friction of displacements u (2, n_boundary)."""
        model, rim = self.model, self.faces.rim
        s = area[:, rim]
        load = model.active_stress(a[rim], phi[rim], model.delta_on_rim()) * s
        if model.closure is Closure.IRROTATIONAL_WALL:
            edge = np.array([-s[1], s[0]])
            load -= model.elastic_moduli()[0] * (u * edge).sum(axis=0) / np.hypot(*s) * edge
        return np.where(self.ties.on_rim, load, 0.0)

    def _least(self, seen: Array) -> Array:
        """The smallest of the faces' values (2, n_faces) around each cell."""
        least: Array = seen.min(axis=0)[self.faces.of_cell].min(axis=0)
        return least

    def _kink(self, diamonds: Diamonds, x: Array, weights: Array, jump: Array) -> Array:
        """What the jump of the normal derivative adds to interpolated velocities, (2, N)."""
        faces, ring, star, count = self.faces, self.ring, self.faces.star, x.shape[1]
        if not ring.size:
            return np.zeros_like(x)
        outwards = np.where(self.delta[faces.cells[0, ring]] == 0, 1.0, -1.0) * diamonds.area[:, ring]
        ends = faces.nodes[:, ring].ravel()
        normal = np.array([np.bincount(ends, np.tile(part, 2), count) for part in outwards])
        normal /= np.where(np.hypot(*normal) > 0, np.hypot(*normal), 1.0)
        meeting = np.bincount(ends, minlength=count)
        slope = np.array([np.bincount(ends, np.tile(part, 2), count) for part in jump])
        slope /= np.maximum(meeting, 1)
        beyond = np.concatenate([self.delta, self.delta[faces.cells[0, faces.rim]]])[star.value] > 0
        offset = diamonds.places[:, star.value] - x[:, star.vertex]
        height = np.where(beyond, (normal[:, star.vertex] * offset).sum(axis=0), 0.0)
        return -np.bincount(star.vertex, weights * height, count) * slope

    def _place(self, cell: int) -> str:
        where = self.mesh.centroids[:, cell]
        return f"in the triangle that started at ({where[0]:.3f}, {where[1]:.3f})"


def _gradients(x: Array, mesh: Mesh, u: Array) -> Array:
    """Gradients (2 components, 2, n_cells) of vertex values u (2, N) within the triangles at x."""
    corners, values = x[:, mesh.triangles], u[:, mesh.triangles]
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    twice = one[0] * two[1] - one[1] * two[0]
    first, second = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    across = np.array([two[1], -two[0]]) / twice
    along = np.array([-one[1], one[0]]) / twice
    gradients: Array = first[:, None] * across + second[:, None] * along
    return gradients
