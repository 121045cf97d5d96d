"""Spectral elements on one ray of the reference disk, and what their fields are drawn on."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss, legvander

from actin_xcheck.core.contract import Frame
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array
from fem.fields import Lattice, cell_means
from fem.space import Space

MORE_POINTS = 3
"""Gauss points of an element beyond its degree: products of the fields are no polynomials."""


@dataclass(frozen=True, eq=False)
class Ray:
    """Continuous polynomials in the material radius R, element by element, on 0 <= R <= 1.

    They meet on the ring, where the active stress jumps, and are equally wide on either side of it.

    Attributes
    ----------
    ends : where elements meet, 0 and 1 included, (n_elements + 1,).
    degree : of the polynomials, at least 1.
    """

    ends: Array
    degree: int

    @classmethod
    def on(cls, ring: float, elements: int, degree: int) -> "Ray":
        """Put half of the elements, at least one, on either side of R = `ring`: the outer ones are narrow."""
        outside = max(elements // 2, 1)
        inside = max(elements - outside, 1)
        inner, outer = np.linspace(0, ring, inside + 1), np.linspace(ring, 1, outside + 1)
        return cls(np.concatenate([inner, outer[1:]]), degree)

    @cached_property
    def nodes(self) -> Array:
        """Material radii of the nodes, (N,)."""
        local = self._placed(self._lobatto)
        return np.append(local[:, :-1].ravel(), 1.0)

    @cached_property
    def points(self) -> Array:
        """Material radii of the Gauss points and, as the last one, of the rim, (Q,)."""
        return np.append(self._placed(self._gauss[0]).ravel(), 1.0)

    @cached_property
    def weights(self) -> Array:
        """Their weights, (Q,): integrals over R; the rim has none."""
        return np.append(np.outer(np.diff(self.ends) / 2, self._gauss[1]).ravel(), 0.0)

    @cached_property
    def values(self) -> Array:
        """Basis functions at these points, (Q, N)."""
        return self.at(self.points)[0]

    @cached_property
    def slopes(self) -> Array:
        """Their derivatives in R, (Q, N)."""
        return self.at(self.points)[1]

    @cached_property
    def centre_slopes(self) -> Array:
        """Their derivatives in R at the centre, (N,)."""
        return self.at(np.zeros(1))[1][0]

    def at(self, radii: Array) -> tuple[Array, Array]:
        """Basis functions and their derivatives in R at material radii (k,), (k, N) each."""
        count = len(self.ends) - 1
        element = np.clip(np.searchsorted(self.ends, radii) - 1, 0, count - 1)
        width = np.diff(self.ends)[element]
        place = 2 * (radii - self.ends[element]) / width - 1
        to_modes = np.linalg.inv(legvander(self._lobatto, self.degree))
        derived = np.array([Legendre.basis(j).deriv()(place) for j in range(self.degree + 1)]).T
        rows = np.arange(len(radii))[:, None]
        columns = element[:, None] * self.degree + np.arange(self.degree + 1)
        values, slopes = np.zeros((2, len(radii), count * self.degree + 1))
        values[rows, columns] = legvander(place, self.degree) @ to_modes
        slopes[rows, columns] = derived @ to_modes * (2 / width)[:, None]
        # a constant has no slope, to the last digit: conservation rests on it
        return values, slopes - slopes.sum(axis=1, keepdims=True) * values

    @cached_property
    def _lobatto(self) -> Array:
        inner = np.sort(np.real(Legendre.basis(self.degree).deriv().roots()))
        return np.concatenate([[-1.0], inner, [1.0]])

    @cached_property
    def _gauss(self) -> tuple[Array, Array]:
        points, weights = leggauss(self.degree + MORE_POINTS)
        return points, weights

    def _placed(self, local: Array) -> Array:
        """Points of the reference element [-1, 1], (k,), in every element, (n_elements, k)."""
        start, width = self.ends[:-1, None], np.diff(self.ends)[:, None]
        return start + width * (1 + local) / 2


class FrameMesh:
    """What frames of fields known everywhere are drawn on: quadratic curved cells.

    Parameters
    ----------
    mesh : of the disk.
    ring : radius from which its layers are circles.
    """

    def __init__(self, mesh: Mesh, ring: float) -> None:
        self._space = Space.on(mesh, 2, ring)
        self.grid = Lattice(self._space, mesh.triangles).grid

    def frame(self, x: Array, v: Array, a: Array) -> Frame:
        """Positions, velocities (2, n) and concentrations (n,) at the grid's nodes, with the cells' means."""
        return Frame(x, v, a, cell_means(self._space, x, a))
